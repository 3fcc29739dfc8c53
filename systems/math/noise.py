"""Counter-based noise: a draw is a function of (seed, stream, tick), so that a system keeps no random generator."""

from __future__ import annotations

import zlib
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

BLOCK = 256
"""Number of ticks that are drawn at once: to start a generator takes much longer than to draw a number."""


def standard_normal(seed: int, stream: str, tick: int, size: int) -> NDArray[np.float64]:
    """Returns ``size`` independent standard normal numbers, which depend on the arguments only.

    The array cannot be written to: the numbers of `BLOCK` ticks are drawn together, and kept for a while.

    Args:
        seed: Seed of the scenario, >= 0.
        stream: Name of the noise; different names with the same seed give independent numbers.
        tick: Number of the sample, >= 0.
        size: Number of values to draw.
    """
    block, row = divmod(tick, BLOCK)
    numbers: NDArray[np.float64] = _draw_block(seed, stream, block, size)[row]
    return numbers


def standard_normals(seed: int, stream: str, ticks: int, size: int) -> NDArray[np.float64]:
    """Returns the numbers (ticks, size) of the first ticks; see `standard_normal`."""
    blocks = [_draw_block(seed, stream, block, size) for block in range(-(-ticks // BLOCK))]
    return np.concatenate(blocks)[:ticks]


@lru_cache(maxsize=16)  # a run has a few streams, and reads each one in the order of its ticks
def _draw_block(seed: int, stream: str, block: int, size: int) -> NDArray[np.float64]:
    """Returns the numbers (BLOCK, size) of the ticks from ``block`` x `BLOCK` on."""
    numbers = np.random.default_rng([seed, zlib.crc32(stream.encode()), block]).standard_normal((BLOCK, size))
    numbers.setflags(write=False)
    return numbers
