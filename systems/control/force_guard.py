"""Watches over a learnt controller: yields to force, backs off when stuck, and goes on; it learns nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from models.scenario import ControllerParameters

WORKING, BACKING_OFF = 0.0, 1.0


@dataclass(frozen=True)
class GuardState:
    """What the supervisor remembers from one period to the next; `as_list` fits a discrete state.

    Attributes:
        mode: WORKING or BACKING_OFF.
        elapsed: in this mode, or since the last progress, s.
        anchor: depth from which progress, or the way back, is measured, m.
        doubt: for how long the skill has not recognised what it feels, s.
    """

    mode: float = WORKING
    elapsed: float = 0.0
    anchor: float = -1.0
    doubt: float = 0.0

    def as_list(self) -> list[float]:
        """[mode, elapsed, anchor, doubt]."""
        return [self.mode, self.elapsed, self.anchor, self.doubt]


@dataclass(frozen=True)
class GuardDecision:
    """What the supervisor lets through.

    Attributes:
        watch: to be handed to the next step.
        feed_speed: m/s.
        turning: whether the learnt correction may act.
        unwinding: whether the hole is to turn back to where the load was last light.
    """

    watch: GuardState
    feed_speed: float
    turning: bool
    unwinding: bool = False


def contact_load(wrench: NDArray[np.float64], peg_radius: float) -> float:
    """sqrt(|f|^2 + |m/r|^2), N, of a wrench (6,), force (N) then moment (N m), on a peg of radius r (m).

    A wedged peg holds a large couple under a small net force.
    """
    return float(np.hypot(np.linalg.norm(wrench[:3]), np.linalg.norm(wrench[3:6]) / peg_radius))


def guard_step(
    p: ControllerParameters,
    watch: GuardState,
    *,
    period: float,
    feed_speed: float,
    load: float,
    depth: float,
    known: bool,
    support: float,
) -> GuardDecision:
    """One period of supervision.

    While working, the learnt feed v into the hole is lowered to

        v s min(1, max(0, (F_hold - F) / (F_hold - F_soft))) (``unknown_feed`` if the contact state is unknown),

    with s the support of the action, and F the load (`contact_load`). The peg is backed off

    * as soon as the load passes F_limit,
    * when it was pushed for ``stall_time`` without coming ``stall_depth`` deeper,
    * when the skill has not recognised what it feels (unknown, or less than full support) for ``doubt_time``.

    Backing off ends ``back_off_distance`` higher, or after ``back_off_time``; then it is tried again. A wedged peg
    cannot be drawn back, for its turns have squeezed it: from half of that time on they are unwound, unless it has
    come ``stall_depth`` higher.

    Args:
        p: the guards.
        watch: of the last period.
        period: s.
        feed_speed: what the skill wants, m/s, negative into the hole.
        load: of the contact, N.
        depth: measured, m.
        known: whether the estimator recognises the contact state.
        support: of the skill's action by what it remembers, 0 to 1 (see `Action`).
    """
    if watch.mode == BACKING_OFF:
        done = watch.anchor - depth >= p.back_off_distance or watch.elapsed >= p.back_off_time
        if not done:
            stuck = watch.elapsed >= 0.5 * p.back_off_time and watch.anchor - depth < p.stall_depth
            watch = replace(watch, elapsed=watch.elapsed + period)
            return GuardDecision(watch, p.retract_speed, turning=False, unwinding=stuck)
        watch = GuardState(anchor=depth)
    progressed = depth - watch.anchor >= p.stall_depth
    doubt = 0.0 if known and support >= 1.0 else watch.doubt + period
    watch = (
        GuardState(anchor=depth, doubt=doubt)
        if progressed
        else replace(watch, elapsed=watch.elapsed + period, doubt=doubt)
    )
    pushing = feed_speed < 0.0
    if load > p.force_limit or (pushing and (watch.elapsed > p.stall_time or watch.doubt > p.doubt_time)):
        return GuardDecision(GuardState(BACKING_OFF, anchor=depth), p.retract_speed, turning=False)
    if pushing:
        feed_speed *= support * min(1.0, max(0.0, (p.hold_force - load) / (p.hold_force - p.soft_force)))
        feed_speed *= 1.0 if known else p.unknown_feed
    return GuardDecision(watch, feed_speed, turning=True)
