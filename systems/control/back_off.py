"""The back-off: it draws the peg back when a policy is stuck or does not recognise what it measures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, field, fields, replace
from enum import IntEnum
from typing import Self

from models.control import BackOffParameters


class BackOffMode(IntEnum):
    """What happens at present."""

    WORKING = 0
    BACKING_OFF = 1


@dataclass(frozen=True)
class TurnWatch:
    """What was measured at the last sign that the present turns help, or do no harm.

    Attributes:
        pitch, yaw: commanded angles of the hole, rad.
        side: lateral force, N.
        depth: depth of the tip, m.
        elapsed: time since then, s.
    """

    pitch: float = 0.0
    yaw: float = 0.0
    side: float = 0.0
    depth: float = -1.0
    elapsed: float = 0.0


@dataclass(frozen=True)
class BackOffState:
    """State of the back-off between two periods.

    Attributes:
        mode: present mode.
        elapsed: time since the back-off began, or since the last progress, s.
        anchor: depth from which progress or the back-off is measured, m.
        doubt: time for which the policy has not recognised its measurements, s.
        best: largest depth at which an attempt ended, m.
        contact_state: number of the contact state in which the last attempt ended; -1 before the first.
        repeats: attempts in a row that ended like the one before.
        reversing: 1 if the turns of the policy are reversed, else 0.
        changes: how often that has changed within the present attempt.
        reversed_at: depth where the turns were last reversed, m.
        watch: what tells whether the turns make it worse.
    """

    mode: BackOffMode = BackOffMode.WORKING
    elapsed: float = 0.0
    anchor: float = -1.0
    doubt: float = 0.0
    best: float = -1.0
    contact_state: float = -1.0
    repeats: float = 0.0
    reversing: float = 0.0
    changes: float = 0.0
    reversed_at: float = 0.0
    watch: TurnWatch = field(default_factory=TurnWatch, kw_only=True)

    def as_list(self) -> list[float]:
        """Returns the numbers of a discrete state, in the order of the attributes."""
        attempt = (self.best, self.contact_state, self.repeats, self.reversing, self.changes, self.reversed_at)
        return [float(self.mode), self.elapsed, self.anchor, self.doubt, *attempt, *astuple(self.watch)]

    @classmethod
    def from_list(cls, values: Sequence[float]) -> Self:
        """Inverts `as_list`."""
        number = len(fields(TurnWatch))
        mode, *others = values[:-number]
        return cls(BackOffMode(int(mode)), *others, watch=TurnWatch(*values[-number:]))


@dataclass(frozen=True)
class BackOffDecision:
    """What is commanded for one period.

    Attributes:
        state: state for the next period.
        feed_speed: feed speed, m/s, negative into the hole.
        turning: 1 if the turn of the policy is applied, -1 if it is reversed, 0 if it is not applied.
        unwinding: whether the hole turns back to its angles at the last light load.
        given_up: whether the policy has nothing new to try.
    """

    state: BackOffState
    feed_speed: float
    turning: float
    unwinding: bool = False
    given_up: bool = False


def back_off_step(
    p: BackOffParameters,
    state: BackOffState,
    *,
    period: float,
    feed_speed: float,
    overloaded: bool,
    depth: float,
    known: bool,
    support: float,
    contact_state: int,
    angles: tuple[float, float],
    side: float,
) -> BackOffDecision:
    """Returns the decision for one period.

    While working, a feed v into the hole is reduced to v s, where s is the support of the action, and further by the
    factor ``unknown_feed`` in an unknown contact state. The peg is backed off

    * when the load exceeds F_limit, the ``force_limit`` of the guard,
    * when the policy has pushed for ``stall_time`` without a gain in depth of ``stall_depth``,
    * when the policy has not recognised its measurements (state unknown or support below 1) for ``doubt_time``.

    A back-off ends when the peg is ``distance`` higher, or after ``time``. Retraction cannot free a
    peg that its own turns have wedged. If the peg has not risen by ``stall_depth`` after half of ``time``,
    the turns are therefore unwound (see `ForceGuard`).

    An attempt ends with a back-off. A policy without memory measures the same again in the next one and does the same
    again. What it did is therefore judged by its result (win-stay, lose-shift; Robbins, "Some aspects of the sequential
    design of experiments", 1952): after an attempt that is not deeper than all before by ``stall_depth``, the next one
    turns the other way, and so do those that follow while each is deeper, at any depth. Near the mouth the same force
    can ask for opposite turns, so that the other way is the likeliest remedy.

    Within a later attempt, turns that make it worse are noticed sooner. The lateral force rises with a turn the wrong
    way, and the peg does not go deeper. If it has risen by ``worse_force`` while the hole turned by ``worse_turn`` in
    at least ``worse_time``, all since the depth has last grown by ``worse_depth`` or the force was last as low, the
    turns are reversed at once, and the time without progress begins anew (``max_repeats`` times in an attempt). The end
    of an attempt in which the turns were reversed does not reverse them again. In the first attempt few turns are
    wrong, and most such signs would be false. A reversal is a remedy for the place where the peg was stuck: when the
    peg is deeper by ``reversal_depth``, the turns are those of the policy again.

    An attempt repeats the one before if it is not deeper and ended in the same contact state. After ``max_repeats``
    repetitions, and the back-off that follows, the policy has nothing new to try and gives up.

    Args:
        p: thresholds.
        state: state after the last period.
        period: duration of a period, s.
        feed_speed: feed speed of the policy, m/s, negative into the hole.
        overloaded: whether the contact load exceeds F_limit.
        depth: measured depth of the tip, m.
        known: whether the estimator recognises the contact state.
        support: support of the action, 0 to 1 (see `Action`).
        contact_state: number of the most probable contact state.
        angles: commanded pitch and yaw of the hole, rad.
        side: lateral force, N.
    """
    here = TurnWatch(*angles, side, depth)
    if state.mode is BackOffMode.BACKING_OFF:
        risen = state.anchor - depth
        if not (risen >= p.distance or state.elapsed >= p.time):
            stuck = state.elapsed >= 0.5 * p.time and risen < p.stall_depth
            state = replace(state, elapsed=state.elapsed + period)
            return BackOffDecision(state, p.retract_speed, turning=0.0, unwinding=stuck)
        if state.repeats >= p.max_repeats:
            return BackOffDecision(state, 0.0, turning=0.0, given_up=True)
        state = replace(state, mode=BackOffMode.WORKING, elapsed=0.0, anchor=depth, doubt=0.0)
    if depth >= state.watch.depth + p.worse_depth or side <= state.watch.side:
        state = replace(state, watch=here)
    elif _worse(p, state, here):
        elapsed = 0.0 if state.changes < p.max_repeats else state.elapsed
        changes = state.changes + 1.0
        turned = replace(state, reversing=1.0 - state.reversing, reversed_at=depth)
        state = replace(turned, elapsed=elapsed, changes=changes, watch=here)
    else:
        state = replace(state, watch=replace(state.watch, elapsed=state.watch.elapsed + period))
    if state.reversing and depth >= state.reversed_at + p.reversal_depth:
        state = replace(state, reversing=0.0)
    doubt = 0.0 if known and support >= 1.0 else state.doubt + period
    if depth - state.anchor >= p.stall_depth:
        state = replace(state, elapsed=0.0, anchor=depth, doubt=doubt)
    else:
        state = replace(state, elapsed=state.elapsed + period, doubt=doubt)
    pushing = feed_speed < 0.0
    if overloaded or (pushing and (state.elapsed > p.stall_time or state.doubt > p.doubt_time)):
        return BackOffDecision(_attempt_over(p, state, depth, contact_state), p.retract_speed, turning=0.0)
    if pushing:
        feed_speed *= support if known else support * p.unknown_feed
    return BackOffDecision(state, feed_speed, turning=-1.0 if state.reversing else 1.0)


def _worse(p: BackOffParameters, state: BackOffState, here: TurnWatch) -> bool:
    """Whether the turn since the watch began, in an attempt after the first, has made it worse."""
    watch, first = state.watch, state.contact_state < 0.0
    turn = math.hypot(here.pitch - watch.pitch, here.yaw - watch.yaw)
    grown = here.side - watch.side >= p.worse_force
    return not first and grown and turn >= p.worse_turn and watch.elapsed >= p.worse_time


def _attempt_over(p: BackOffParameters, state: BackOffState, depth: float, contact_state: int) -> BackOffState:
    """Returns the state at the start of a back-off."""
    deeper = depth >= state.best + p.stall_depth
    repeated = not deeper and contact_state == state.contact_state
    reverse = not deeper and not state.changes
    return BackOffState(
        BackOffMode.BACKING_OFF,
        anchor=depth,
        best=depth if deeper else state.best,
        contact_state=float(contact_state),
        repeats=state.repeats + 1.0 if repeated else 0.0,
        reversing=1.0 - state.reversing if reverse else state.reversing,
        reversed_at=depth if reverse else state.reversed_at,
    )
