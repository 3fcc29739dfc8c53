"""The back-off: it draws the peg back when a policy is stuck or does not recognise what it measures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Self

from models.scenario import BackOffParameters


class BackOffMode(IntEnum):
    """What happens at present."""

    WORKING = 0
    BACKING_OFF = 1


@dataclass(frozen=True)
class BackOffState:
    """State of the back-off between two periods.

    Attributes:
        mode: present mode.
        elapsed: time since the back-off began, or since the last progress, s.
        anchor: depth from which progress or the back-off is measured, m.
        doubt: time for which the policy has not recognised its measurements, s.
    """

    mode: BackOffMode = BackOffMode.WORKING
    elapsed: float = 0.0
    anchor: float = -1.0
    doubt: float = 0.0

    def as_list(self) -> list[float]:
        """Returns [mode, elapsed, anchor, doubt], for a discrete state."""
        return [float(self.mode), self.elapsed, self.anchor, self.doubt]

    @classmethod
    def from_list(cls, values: Sequence[float]) -> Self:
        """Inverts `as_list`."""
        mode, elapsed, anchor, doubt = values
        return cls(BackOffMode(int(mode)), elapsed, anchor, doubt)


@dataclass(frozen=True)
class BackOffDecision:
    """What is commanded for one period.

    Attributes:
        state: state for the next period.
        feed_speed: feed speed, m/s, negative into the hole.
        turning: whether the turn of the policy is applied.
        unwinding: whether the hole turns back to its angles at the last light load.
    """

    state: BackOffState
    feed_speed: float
    turning: bool
    unwinding: bool = False


def back_off_step(
    p: BackOffParameters,
    state: BackOffState,
    *,
    period: float,
    feed_speed: float,
    load: float,
    depth: float,
    known: bool,
    support: float,
) -> BackOffDecision:
    """Returns the decision for one period.

    While working, a feed v into the hole is reduced to v s, where s is the support of the action, and further by the
    factor ``unknown_feed`` in an unknown contact state. The peg is backed off

    * when the load exceeds F_limit,
    * when the policy has pushed for ``stall_time`` without a gain in depth of ``stall_depth``,
    * when the policy has not recognised its measurements (state unknown or support below 1) for ``doubt_time``.

    A back-off ends when the peg is ``back_off_distance`` higher, or after ``back_off_time``. Retraction cannot free a
    peg that its own turns have wedged. If the peg has not risen by ``stall_depth`` after half of ``back_off_time``,
    the turns are therefore unwound (see `ForceGuard`).

    Args:
        p: thresholds.
        state: state after the last period.
        period: duration of a period, s.
        feed_speed: feed speed of the policy, m/s, negative into the hole.
        load: contact load, N.
        depth: measured depth of the tip, m.
        known: whether the estimator recognises the contact state.
        support: support of the action, 0 to 1 (see `Action`).
    """
    if state.mode is BackOffMode.BACKING_OFF:
        risen = state.anchor - depth
        if not (risen >= p.back_off_distance or state.elapsed >= p.back_off_time):
            stuck = state.elapsed >= 0.5 * p.back_off_time and risen < p.stall_depth
            state = replace(state, elapsed=state.elapsed + period)
            return BackOffDecision(state, p.retract_speed, turning=False, unwinding=stuck)
        state = BackOffState(anchor=depth)
    doubt = 0.0 if known and support >= 1.0 else state.doubt + period
    if depth - state.anchor >= p.stall_depth:
        state = BackOffState(anchor=depth, doubt=doubt)
    else:
        state = replace(state, elapsed=state.elapsed + period, doubt=doubt)
    pushing = feed_speed < 0.0
    if load > p.force_limit or (pushing and (state.elapsed > p.stall_time or state.doubt > p.doubt_time)):
        return BackOffDecision(BackOffState(BackOffMode.BACKING_OFF, anchor=depth), p.retract_speed, turning=False)
    if pushing:
        feed_speed *= support if known else support * p.unknown_feed
    return BackOffDecision(state, feed_speed, turning=True)
