"""Round steps for axes and scales."""

from __future__ import annotations

import math


def round_step(span: float, max_steps: int = 1) -> float:
    """Returns the smallest of 1, 2 and 5 times a power of ten of which at most ``max_steps`` steps cover ``span``.

    A span of 0 is treated as 1. A relative tolerance of 1e-9 absorbs rounding errors.
    """
    minimum = (span or 1.0) / max_steps
    decade = 10.0 ** math.floor(math.log10(minimum))
    return next(m * decade for m in (1, 2, 5, 10) if m * decade >= minimum * (1 - 1e-9))
