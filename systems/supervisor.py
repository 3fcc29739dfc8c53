"""Watches over a learnt controller: yields to force, backs off when stuck, and goes on; it learns nothing."""

from __future__ import annotations

from dataclasses import dataclass, replace

from models.scenario import Controller

WORKING, BACKING_OFF = 0.0, 1.0


@dataclass(frozen=True)
class Watch:
    """What the supervisor remembers from one period to the next; `as_list` fits a discrete state.

    Attributes:
        mode: WORKING or BACKING_OFF.
        elapsed: in this mode, or since the last progress, s.
        anchor: depth from which progress, or the way back, is measured, m.
    """

    mode: float = WORKING
    elapsed: float = 0.0
    anchor: float = -1.0

    def as_list(self) -> list[float]:
        """[mode, elapsed, anchor]."""
        return [self.mode, self.elapsed, self.anchor]


@dataclass(frozen=True)
class Verdict:
    """What the supervisor lets through.

    Attributes:
        watch: to be handed to the next step.
        feed_speed: m/s.
        turning: whether the learnt correction may act.
    """

    watch: Watch
    feed_speed: float
    turning: bool


def supervise(
    p: Controller, watch: Watch, *, period: float, feed_speed: float, load: float, depth: float, known: bool
) -> Verdict:
    """One period of supervision.

    While working, the learnt feed v into the hole is lowered to

        v min(1, max(0, (F_hold - F) / (F_hold - F_soft))) (1/2 if the contact state is unknown),

    with F the load, sqrt(|f|^2 + |m/r|^2): a wedged peg holds a large couple under a small net force. Further,

    the peg is backed off as soon as the load passes F_limit, or when it was pushed for ``stall_time`` without
    coming ``stall_depth`` deeper. Backing off ends ``back_off_distance`` higher, or after ``back_off_time``.

    Args:
        p: the guards.
        watch: of the last period.
        period: s.
        feed_speed: what the skill wants, m/s, negative into the hole.
        load: of the contact, N.
        depth: measured, m.
        known: whether the estimator recognises the contact state.
    """
    if watch.mode == BACKING_OFF:
        done = watch.anchor - depth >= p.back_off_distance or watch.elapsed >= p.back_off_time
        if not done:
            return Verdict(replace(watch, elapsed=watch.elapsed + period), p.retract_speed, turning=False)
        watch = Watch(anchor=depth)
    progressed = depth - watch.anchor >= p.stall_depth
    watch = Watch(anchor=depth) if progressed else replace(watch, elapsed=watch.elapsed + period)
    if load > p.force_limit or (watch.elapsed > p.stall_time and feed_speed < 0.0):
        return Verdict(Watch(BACKING_OFF, anchor=depth), p.retract_speed, turning=False)
    if feed_speed < 0.0:
        feed_speed *= min(1.0, max(0.0, (p.hold_force - load) / (p.hold_force - p.soft_force)))
        feed_speed *= 1.0 if known else 0.5
    return Verdict(watch, feed_speed, turning=True)
