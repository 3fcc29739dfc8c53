"""The arrays of a stored `LWRegressor`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skill.data.array_schema import MIN_POSITIVE, ArrayRule, check_arrays
from skill.regression.neighbourhood import check_memberships

RULES = {
    "bandwidth": ArrayRule(low=MIN_POSITIVE),
    "bandwidth_type": ArrayRule(holds="texts", choices=("fixed", "adaptive")),
    "degree": ArrayRule(holds="integers", low=0, high=1),
    "ridge": ArrayRule(low=0.0),
    "n_neighbors": ArrayRule(holds="integers", low=-1),
    "feature_scale": ArrayRule(("d",), low=MIN_POSITIVE),
    "X": ArrayRule(("n", "d")),
    "y": ArrayRule(("n", "p")),
    "sample_weight": ArrayRule(("n",), positive=True),
    "rows": ArrayRule(("n",), holds="integers", low=0),
    "single_output": ArrayRule(holds="truth values"),
    "memberships": ArrayRule(("n", "K"), low=0.0, high=1.0 + 1e-6, optional=True),
    "feature_names": ArrayRule(("d",), holds="texts", optional=True),
}
"""n samples, d features, p outputs, K contact states; ``n_neighbors`` is -1 for all samples."""


def check_regressor_arrays(arrays: Mapping[str, NDArray[Any]]) -> None:
    """Checks the arrays that `LWRegressor.to_arrays` returns.

    Raises:
        ValueError: naming the array, what was found and what was expected.
    """
    sizes = check_arrays(arrays, RULES, "LWRegressor.to_arrays")
    if int(arrays["n_neighbors"]) == 0:
        raise ValueError("array 'n_neighbors' is 0, expected -1 or a positive number")
    if bool(arrays["single_output"]) and sizes["p"] != 1:
        raise ValueError(f"array 'y' has {sizes['p']} outputs, expected one as 'single_output' says")
    if (np.diff(np.asarray(arrays["rows"]).astype(np.int64)) <= 0).any():
        raise ValueError("array 'rows' does not increase; expected the numbers of the samples")
    if "memberships" in arrays:
        check_memberships(arrays["memberships"], sizes["n"], exact=True)
