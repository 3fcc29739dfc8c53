"""The speed of the machine, to be stated beside a CPU time.

A CPU time means little elsewhere or on another day. The time of one fixed piece of work, measured in the same run,
makes two of them comparable: divide each by the reference time of its own run.
"""

from __future__ import annotations

import time

import numpy as np
from threadpoolctl import threadpool_limits

ADDITIONS, PRODUCTS, SIZE = 1_000_000, 150, 200


def machine_speed() -> float:
    """Measures the CPU time of the reference loop: additions in pure Python, and products of small matrices.

    Returns:
        The time in one thread, ms, in the order of 100.
    """
    matrix = np.random.default_rng(0).standard_normal((SIZE, SIZE)) / np.sqrt(SIZE)
    with threadpool_limits(1):
        began = time.process_time()
        total = 0
        for number in range(ADDITIONS):
            total += number
        product = matrix
        for _ in range(PRODUCTS):
            product = matrix @ product
        return 1e3 * (time.process_time() - began)
