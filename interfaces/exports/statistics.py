"""Statistics of the features of a data set of LeRobot, of each episode and of all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

Statistics = Mapping[str, Array]
"""min, max, mean, std and quantiles of a feature, (d,) each, and the count of frames, (1,)."""


def feature_statistics(values: NDArray[Any]) -> Statistics:
    """Returns the statistics of a feature over the frames of an episode, (n,) or (n, d)."""
    rows = values.reshape(len(values), -1).astype(float)
    quantiles = np.quantile(rows, list(QUANTILES.values()), axis=0)
    return {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
        "count": np.array([len(rows)]),
        **dict(zip(QUANTILES, quantiles, strict=True)),
    }


def joined_statistics(parts: Sequence[Statistics]) -> Statistics:
    """Returns the statistics of a feature over all episodes.

    All are exact, except the quantiles: they are means of those of the episodes, weighted by the frames, as LeRobot
    computes them.
    """
    joined = {name: np.stack([part[name] for part in parts]) for name in parts[0]}
    count = joined["count"]
    total = count.sum(axis=0)

    def mean(values: Array) -> Array:
        return np.asarray((values * count).sum(axis=0) / total)

    middle = mean(joined["mean"])
    return {
        "min": joined["min"].min(axis=0),
        "max": joined["max"].max(axis=0),
        "mean": middle,
        "std": np.sqrt(mean(joined["std"] ** 2 + (joined["mean"] - middle) ** 2)),
        "count": total,
        **{name: mean(joined[name]) for name in QUANTILES},
    }


def as_lists(statistics: Statistics) -> dict[str, list[Any]]:
    """Returns the statistics as lists, for JSON and Parquet."""
    return {name: values.tolist() for name, values in statistics.items()}
