"""Counter-based noise: a draw is a function of (seed, stream, tick), so that a system keeps no random generator."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray


def standard_normal(seed: int, stream: str, tick: int, size: int) -> NDArray[np.float64]:
    """Returns ``size`` independent standard normal numbers, which depend on the arguments only.

    Args:
        seed: Seed of the scenario, >= 0.
        stream: Name of the noise; different names with the same seed give independent numbers.
        tick: Number of the sample, >= 0.
        size: Number of values to draw.
    """
    return np.random.default_rng([seed, zlib.crc32(stream.encode()), tick]).standard_normal(size)
