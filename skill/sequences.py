"""Rows of samples that belong together: the demonstrations or recordings of a table of samples."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray


def sequences(groups: NDArray[np.intp]) -> Iterator[NDArray[np.intp]]:
    """Yields the rows of each group, shape (n,), in their order.

    Args:
        groups: shape (N,), group of each row.
    """
    order = np.argsort(groups, kind="stable")
    yield from np.split(order, np.flatnonzero(np.diff(groups[order])) + 1)
