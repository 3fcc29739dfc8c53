"""What a policy is asked and what it answers, in the frame of the features, and the explanation of an action."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skill.arrays import Array
from skill.policy.rig_policy import Action
from skill.regression.protocols import Explanation

MAX_PRINTED = 5  # samples in the printed explanation


class Query(NamedTuple):
    """One measurement, and what is believed at that time.

    Attributes:
        row: (1, 7), the measurement: fx fy fz (N) mx my mz (N m) z (m).
        X: (1, d), its features.
        P: (1, K), probabilities of the contact states.
    """

    row: Array
    X: Array
    P: Array


class DesiredState(NamedTuple):
    """The desired next state; the loads are those of `skill.policy.transitions`.

    Attributes:
        state: its number; K for the insertion itself.
        share: the share of the votes for it, 0 to 1.
        change: (5,), change of the loads until it begins, N.
        time: time until then, s.
    """

    state: int
    share: float
    change: Array
    time: float


class Plan(NamedTuple):
    """What a planner expects of its action.

    Attributes:
        desired: the desired next state.
        loads: (5,), the present loads, N.
        expected: (5,), the loads that the forward model expects one horizon later, N.
        beyond: (5,), how far they are expected outside the bounds of the state, N; zero inside.
    """

    desired: DesiredState
    loads: Array
    expected: Array
    beyond: Array


class NearSamples(NamedTuple):
    """The demonstrated samples near a query.

    Attributes:
        rows: (k,), their numbers in the regressor.
        weights: (k,), their kernel weights, over the greatest.
    """

    rows: NDArray[np.intp]
    weights: Array


class Prediction(NamedTuple):
    """The action at one query.

    Attributes:
        action: (3,), turn about x and y (rad) and feed (m) in the frame of the features, over one sample period.
        support: see `skill.policy.rig_policy.Action`.
        limited: whether a turn was limited to what the neighbours did; see `Imitation`.
        samples: the demonstrated samples nearby; None for a regressor that does not tell them.
        plan: what a planner expects; None for an imitation.
    """

    action: Array
    support: float
    limited: bool
    samples: NearSamples | None = None
    plan: Plan | None = None


@dataclass(frozen=True)
class SkillExplanation:
    """Explanation of one action of a skill.

    Attributes:
        query: the measurement, and what is believed.
        prediction: the action in the frame of the features.
        action: the action.
        local: explanation of the regression of (turn_x, turn_y, feed) in the frame of the features, before its turns
            are limited.
        sources: (n, 2), demonstration number and time (s) of each sample of the regressor.
        state_names: names of the K contact states.
        frame_angle: angle from P to the frame of the features about z, rad.
    """

    query: Query
    prediction: Prediction
    action: Action
    local: Explanation
    sources: Array
    state_names: list[str]
    frame_angle: float

    @property
    def neighbours(self) -> pd.DataFrame:
        """The samples used, in order of decreasing weight.

        Columns: ``demonstration`` (number), ``time`` (s), ``weight`` (over the greatest), ``influence`` (the action is
        the sum of influence times demonstrated action, unless its turn is limited).
        """
        demonstration, time = self.sources[self.local.neighbours].T
        weights = {"weight": self.local.weights, "influence": self.local.influence}
        return pd.DataFrame({"demonstration": demonstration.astype(int), "time": time} | weights)

    def __str__(self) -> str:
        """The explanation in degrees and millimetres."""
        P, local, plan = self.query.P[0], self.local, self.prediction.plan
        states = ", ".join(f"{self.state_names[k]} {P[k]:.0%}" for k in np.argsort(-P) if P[k] >= 0.01)
        turn, low, high = np.degrees(self.action.turn), np.degrees(local.lower[:2]), np.degrees(local.upper[:2])
        return "\n".join(
            [
                f"states: {states}",
                *(["the turn is limited to the quartiles of what was done nearby"] if self.prediction.limited else []),
                f"turn {turn[0]:+.3f} {turn[1]:+.3f} deg, feed {1e3 * self.action.feed:+.3f} mm, in one sample period",
                *([] if plan is None else self._planned(plan)),
                f"{local.level:.0%} interval in the contact frame ({np.degrees(self.frame_angle):+.0f} deg about z):"
                f" turn {low[0]:+.3f}..{high[0]:+.3f}, {low[1]:+.3f}..{high[1]:+.3f} deg,"
                f" feed {1e3 * local.lower[2]:+.3f}..{1e3 * local.upper[2]:+.3f} mm",
                f"support {local.support:.1f} samples, log of the greatest kernel weight {local.log_w_max:.1f}",
                *(
                    f"  demonstration {demonstration:.0f} at {time:.2f} s: weight {weight:.2f}"
                    for demonstration, time, weight, _ in self.neighbours.head(MAX_PRINTED).to_numpy()
                ),
            ]
        )

    def _planned(self, plan: Plan) -> list[str]:
        """The plan in words."""
        desired = plan.desired
        name = self.state_names[desired.state] if desired.state < len(self.state_names) else "the insertion"
        size, to = (float(np.hypot(*loads[:2])) for loads in (plan.loads, plan.loads + desired.change))
        expected = float(np.hypot(*plan.expected[:2]))
        beyond = float(np.abs(plan.beyond).max())
        return [
            f"desired next: {name} ({desired.share:.0%}) in {desired.time:.2f} s; lateral force {size:.1f} N now,"
            f" {expected:.1f} N expected after this action kept for 0.1 s, {to:.1f} N desired",
            *([f"the loads are expected {beyond:.1f} N beyond the bounds of the state"] if beyond > 0.05 else []),
        ]
