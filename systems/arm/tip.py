"""The commanded tip of a peg that an arm carries: how it is fed, and how it yields to the hole."""

from __future__ import annotations

import numpy as np

from models.arm import ArmParameters
from skill.arrays import Array

HEIGHT, RATE, X, Y, SIZE = range(5)
"""Places in the state: height of the tip over the mouth (m) and its rate (m/s), and where the mouth is believed to be
beside the point that the scenario names, along x and y of W (m); and its size."""


def tip_step(arm: ArmParameters, period: float, state: Array, feed: float, push: Array) -> Array:
    """Returns the next state (SIZE,) of the tip.

    With the lateral force f of the world on the peg, the mouth is taken to be where f pushes the peg to: its place
    moves along f with the speed ``yield_softness`` (|f| - ``yield_threshold``), until the tip is at ``yield_depth``.
    The feed is slow meanwhile. Deeper in the hole a lateral force comes from the tilt, which the policy corrects.

    Args:
        arm: limits.
        period: from one command to the next, s.
        state: (SIZE,).
        feed: commanded speed of the tip along the axis of the peg, m/s.
        push: (2,), measured force on the peg along x and y of W, N.
    """
    found, top = state.copy(), arm.max_speed
    is_centring = -arm.yield_depth < state[HEIGHT] < 0.0
    wanted = min(max(feed, -min(top, arm.yield_feed) if is_centring else -top), top)
    change = arm.max_acceleration * period
    found[RATE] += min(max(wanted - state[RATE], -change), change)
    found[HEIGHT] += period * found[RATE]
    force = float(np.hypot(*push))
    if force > arm.yield_threshold and state[HEIGHT] > -arm.yield_depth:
        speed = min(arm.yield_softness * (force - arm.yield_threshold), arm.yield_speed)
        found[X : Y + 1] += period * speed / force * push
        distance = float(np.hypot(*found[X : Y + 1]))
        if distance > arm.yield_reach:
            found[X : Y + 1] *= arm.yield_reach / distance
    return found
