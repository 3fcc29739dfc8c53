"""Counter-based noise: a draw is a function of (seed, stream, tick), so that no generator hides in a system."""

from __future__ import annotations

import zlib

import numpy as np
from numpy.typing import NDArray


def standard_normal(seed: int, stream: str, tick: int, size: int) -> NDArray[np.float64]:
    """``size`` independent standard normal numbers, the same for the same arguments.

    Args:
        seed: of the scenario.
        stream: the name of the noise, so that two systems with one seed draw different numbers.
        tick: number of the sample, >= 0.
        size: how many.
    """
    return np.random.default_rng([seed, zlib.crc32(stream.encode()), tick]).standard_normal(size)
