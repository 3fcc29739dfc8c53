"""The reversal of turns that make it worse, within an attempt of a policy."""

from __future__ import annotations

import math
from typing import NamedTuple

from compiled import compiled
from models.control import BackOffParameters


class TurnWatch(NamedTuple):
    """What is remembered of the turns of an attempt.

    Attributes:
        reversing: 1 if the turns of the policy are reversed, else 0.
        changes: how often that has changed within the attempt.
        reversed_at: depth where the turns were last reversed, m.
        pitch, yaw, side, depth: what was measured at the last sign that the present turns help, or do no harm:
            commanded angles of the hole, rad, lateral force, N, and depth of the tip, m.
        time: time since then, s.
    """

    reversing: float = 0.0
    changes: float = 0.0
    reversed_at: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    side: float = 0.0
    depth: float = -1.0
    time: float = 0.0


@compiled
def turn_reversal_step(
    p: BackOffParameters,
    watch: TurnWatch,
    period: float,
    depth: float,
    pitch: float,
    yaw: float,
    side: float,
    is_first: bool,
) -> tuple[TurnWatch, bool]:
    """Returns the watch after a period, and whether turns that make it worse were noticed.

    The lateral force rises with a turn the wrong way, and the peg does not go deeper. If it has risen by
    ``worse_force`` while the hole turned by ``worse_turn`` in at least ``worse_time``, all since the depth has last
    grown by ``worse_depth`` or the force was last as low, the turns are reversed at once. In the first attempt few
    turns are wrong, and most such signs would be false. A reversal is a remedy for the place where the peg was stuck:
    when the peg is deeper by ``reversal_depth``, the turns are those of the policy again.

    Args:
        p: thresholds.
        watch: after the last period.
        period: s.
        depth: measured depth of the tip, m.
        pitch: commanded angle of the hole, rad.
        yaw: likewise.
        side: lateral force, N.
        is_first: whether this is the first attempt.
    """
    reversing, changes, reversed_at, is_worse = watch.reversing, watch.changes, watch.reversed_at, False
    turned = math.hypot(pitch - watch.pitch, yaw - watch.yaw) >= p.worse_turn and watch.time >= p.worse_time
    is_sign = depth >= watch.depth + p.worse_depth or side <= watch.side
    if not is_sign and not is_first and turned and side - watch.side >= p.worse_force:
        is_worse, changes, reversing, reversed_at = True, changes + 1.0, 1.0 - reversing, depth
    if reversing != 0.0 and depth >= reversed_at + p.reversal_depth:
        reversing = 0.0
    if is_sign or is_worse:
        return TurnWatch(reversing, changes, reversed_at, pitch, yaw, side, depth, 0.0), is_worse
    later = watch.time + period
    return TurnWatch(reversing, changes, reversed_at, watch.pitch, watch.yaw, watch.side, watch.depth, later), is_worse
