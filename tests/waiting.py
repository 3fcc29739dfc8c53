"""Waiting for what another thread or process does."""

import time


def until(condition, seconds=10.0):
    """Waits until a condition holds, and returns whether it does."""
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(2e-3)
    return condition()
