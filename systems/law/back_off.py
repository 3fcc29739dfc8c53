"""The back-off: it draws the peg back when a policy is stuck or does not recognise what it measures.

Turns that make it worse are reversed (`systems.law.turn_reversal`).
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

from compiled import compiled, numbers_class
from models.control import BackOffParameters
from systems.law.turn_reversal import TurnWatch, turn_reversal_step

BackOffNumbers = numbers_class("BackOffNumbers", BackOffParameters, __name__)
"""`models.control.BackOffParameters` for compiled functions."""


class BackOffMode(IntEnum):
    """What happens at present."""

    WORKING = 0
    BACKING_OFF = 1


WORKING, BACKING_OFF = float(BackOffMode.WORKING), float(BackOffMode.BACKING_OFF)


class BackOffState(NamedTuple):
    """State of the back-off between two periods.

    Attributes:
        mode: present `BackOffMode`.
        elapsed: time since the back-off began, or since the last progress, s.
        anchor: depth from which progress or the back-off is measured, m.
        doubt: time for which the policy has not recognised its measurements, s.
        best: largest depth at which an attempt ended, m.
        contact_state: number of the contact state in which the last attempt ended; -1 before the first.
        repeats: attempts in a row that ended like the one before.
        watch: of the turns.
    """

    mode: float = 0.0
    elapsed: float = 0.0
    anchor: float = -1.0
    doubt: float = 0.0
    best: float = -1.0
    contact_state: float = -1.0
    repeats: float = 0.0
    watch: TurnWatch = TurnWatch()


def attempts_text(state: BackOffState, names: Sequence[str]) -> str:
    """Returns what a policy has tried that has nothing new to try, with the names of the contact states."""
    attempts, name = 1 + int(state.repeats), names[int(state.contact_state)]
    return f"{attempts} attempts in a row ended in {name!r}, none deeper than {1e3 * state.best:.1f} mm"


class BackOffDecision(NamedTuple):
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
    unwinding: bool
    given_up: bool


@compiled
def back_off_step(
    p: BackOffParameters,
    state: BackOffState,
    period: float,
    feed_speed: float,
    overloaded: bool,
    depth: float,
    known: bool,
    support: float,
    contact_state: float,
    pitch: float,
    yaw: float,
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

    Within a later attempt, turns that make it worse are noticed sooner and reversed at once (`turn_reversal_step`), and
    the time without progress begins anew (``max_repeats`` times in an attempt). The end of an attempt in which the
    turns were reversed does not reverse them again.

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
        pitch: commanded angle of the hole, rad.
        yaw: likewise.
        side: lateral force, N.
    """
    contact_state = float(contact_state)
    mode, elapsed, anchor, doubt, best, last_contact, repeats, watch = state
    if mode == BACKING_OFF:
        risen = anchor - depth
        if not (risen >= p.distance or elapsed >= p.time):
            stuck = elapsed >= 0.5 * p.time and risen < p.stall_depth
            state = BackOffState(mode, elapsed + period, anchor, doubt, best, last_contact, repeats, watch)
            return BackOffDecision(state, p.retract_speed, 0.0, stuck, False)
        if repeats >= p.max_repeats:
            return BackOffDecision(state, 0.0, 0.0, False, True)
        mode, elapsed, anchor, doubt = WORKING, 0.0, depth, 0.0
    before = watch.changes
    watch, is_worse = turn_reversal_step(p, watch, period, depth, pitch, yaw, side, last_contact < 0.0)
    if is_worse and before < p.max_repeats:
        elapsed = 0.0
    doubt = 0.0 if known and support >= 1.0 else doubt + period
    if depth - anchor >= p.stall_depth:
        elapsed, anchor = 0.0, depth
    else:
        elapsed += period
    pushing = feed_speed < 0.0
    if overloaded or (pushing and (elapsed > p.stall_time or doubt > p.doubt_time)):  # the attempt is over
        deeper = depth >= best + p.stall_depth
        repeats = repeats + 1.0 if not deeper and contact_state == last_contact else 0.0
        is_reversed = not deeper and watch.changes == 0.0
        reversing = 1.0 - watch.reversing if is_reversed else watch.reversing
        fresh = TurnWatch(reversing, 0.0, depth if is_reversed else watch.reversed_at, 0.0, 0.0, 0.0, -1.0, 0.0)
        best = depth if deeper else best
        ended = BackOffState(BACKING_OFF, 0.0, depth, 0.0, best, contact_state, repeats, fresh)
        return BackOffDecision(ended, p.retract_speed, 0.0, False, False)
    if pushing:
        feed_speed *= support if known else support * p.unknown_feed
    state = BackOffState(mode, elapsed, anchor, doubt, best, last_contact, repeats, watch)
    return BackOffDecision(state, feed_speed, -1.0 if watch.reversing != 0.0 else 1.0, False, False)
