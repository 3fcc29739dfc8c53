"""The commanded tip of a peg that an arm carries: how it is fed, and how it yields to the hole."""

from __future__ import annotations

from typing import NamedTuple, Self

import numpy as np

from models.arm import ArmParameters
from skill.arrays import Array

HEIGHT, RATE, X, Y, SIZE = range(5)
"""Places in the state: height of the tip over the mouth (m) and its rate (m/s), and where the mouth is believed to be
beside the point that the scenario names, along x and y of W (m); and its size."""


class TipLimits(NamedTuple):
    """What the commanded tip keeps.

    Attributes:
        period: s.
        speed, acceleration: of the feed, m/s and m/s^2.
        softness: speed by which the tip yields to a lateral force, per force, m/s/N.
        threshold: force that it does not yield to, N.
        yield_speed: largest speed of yielding, m/s.
        reach: largest distance by which it yields, m.
        depth: of the tip down to which it yields, m.
        yield_feed: largest speed of the feed into the hole from the mouth down to this depth, m/s.
    """

    period: float
    speed: float
    acceleration: float
    softness: float
    threshold: float
    yield_speed: float
    reach: float
    depth: float
    yield_feed: float

    @classmethod
    def of(cls, arm: ArmParameters, period: float) -> Self:
        """Returns the limits of an arm whose commands change once a period, s."""
        return cls(
            period,
            arm.max_speed,
            arm.max_acceleration,
            arm.yield_softness,
            arm.yield_threshold,
            arm.yield_speed,
            arm.yield_reach,
            arm.yield_depth,
            arm.yield_feed,
        )


def tip_step(p: TipLimits, state: Array, feed: float, push: Array) -> Array:
    """Returns the next state (SIZE,) of the tip.

    With the lateral force f of the world on the peg, the mouth is taken to be where f pushes the peg to: its place
    moves along f with the speed ``softness`` (|f| - ``threshold``), until the tip is at ``depth``. The feed is slow
    meanwhile. Deeper in the hole a lateral force comes from the tilt, which the policy corrects.

    Args:
        p: limits.
        state: (SIZE,).
        feed: commanded speed of the tip along the axis of the peg, m/s.
        push: (2,), measured force on the peg along x and y of W, N.
    """
    found = state.copy()
    is_centring = -p.depth < state[HEIGHT] < 0.0
    wanted = min(max(feed, -min(p.speed, p.yield_feed) if is_centring else -p.speed), p.speed)
    change = p.acceleration * p.period
    found[RATE] += min(max(wanted - state[RATE], -change), change)
    found[HEIGHT] += p.period * found[RATE]
    force = float(np.hypot(*push))
    if force > p.threshold and state[HEIGHT] > -p.depth:
        speed = min(p.softness * (force - p.threshold), p.yield_speed)
        found[X : Y + 1] += p.period * speed / force * push
        distance = float(np.hypot(*found[X : Y + 1]))
        if distance > p.reach:
            found[X : Y + 1] *= p.reach / distance
    return found
