"""Planning: the action that leads to the desired next state within the bounds that good demonstrations keep.

The paper asks that constraints on the state variables be learned, that they determine the desired state and the best
trajectory to it, and that actions be computed with learned dynamics. Over one horizon H, with the loads l, the forward
model l' = l + a + B u, and the desired change c of the loads that the demonstrations take the time T for, the planner
minimises

    |(l' - l - c H / max(T, H)) / s_l|^2  +  |(u - u_0) / s_u|^2  +  |(l' - v) / s_v|^2

over the motion u, no larger than any demonstrated one, and over v within the bounds of the state. The first term leads
to the desired next state as fast as the demonstrations go there. The third penalises loads outside the bounds.

The second term holds what the demonstrations do here: u_0 is the action of `Imitation` over the horizon, and s_u the
standard deviation of their actions nearby. Where they agree, the planner imitates them. Where they contradict each
other, the dynamics decide. This is Bayes' rule for a normal prior of the action and a normal likelihood of the next
state (planning as inference: Toussaint, ICML 2009).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from skill.arrays import Array
from skill.features.wrench_features import WrenchFeatures
from skill.policy.imitation import Imitation
from skill.policy.planning_model import PlanningModel
from skill.policy.prediction import Plan, Prediction, Query
from skill.policy.transitions import N_INPUTS, N_LOADS, horizon_steps, loads_of
from skill.regression.locally_weighted_regression import LWRegressor

LOAD_TOLERANCE = 2.0
"""s_l, N."""

BOUND_TOLERANCE = 1.0
"""s_v, N."""

SMALLEST_SPREAD = np.array([5e-4, 5e-4, 5e-5])
"""Smallest standard deviation of the turns (rad) and the feed (m) over one horizon."""

NARROWEST = 1e-9
"""N, added to the upper bounds: the solver refuses bounds that are equal."""


@dataclass(frozen=True)
class Planner:
    """Plans actions.

    Attributes:
        model: forward models, desired states and bounds.
        imitation: what the demonstrations do; its regressor is a `LWRegressor`.
        features: define the frame of the loads.
        peg_radius: r, m.
        period: sample period of the actions, s.
    """

    model: PlanningModel
    imitation: Imitation
    features: WrenchFeatures
    peg_radius: float
    period: float

    def predict(self, query: Query) -> Prediction:
        """Returns the planned action for one query."""
        shown = self.imitation.predict(query)
        steps = horizon_steps(self.period)
        log_weights = self.model.log_weights(query.X[0], query.P[0])
        drift, response = self.model.forward(log_weights)
        desired = self.model.desired(log_weights)
        loads = loads_of(query.row, self.features.rotation_angle(query.row), self.peg_radius)[0]
        low, high = self.model.bounds(query.P[0])
        step = desired.change * steps * self.period / max(desired.time, steps * self.period)
        spread = self._spread(shown) * steps + SMALLEST_SPREAD
        motion = best_motion(
            response,
            target=step - drift,
            bounds=(low - loads - drift, high - loads - drift),
            usual=shown.action[:N_INPUTS] * steps,
            spread=spread,
            largest=self.model.largest_input,
        )
        expected = loads + drift + response @ motion
        plan = Plan(desired, loads, expected, expected - np.clip(expected, low, high))
        # A turn about the axis is not planned: the answers of the loads to it are not modelled.
        return shown._replace(action=np.append(motion / steps, shown.action[N_INPUTS:]), plan=plan)

    def _spread(self, shown: Prediction) -> Array:
        """Standard deviation (3,) of the actions of the neighbours, over one sample period."""
        regressor, samples = self.imitation.regressor, shown.samples
        if samples is None or not isinstance(regressor, LWRegressor):
            raise TypeError(f"a {type(regressor).__name__} has no neighbours; expected a regressor such as LWRegressor")
        actions, share = regressor.y_[samples.rows, :N_INPUTS], samples.weights / samples.weights.sum()
        spread: Array = np.sqrt(share @ (actions - share @ actions) ** 2)
        return spread


def best_motion(
    response: Array, *, target: Array, bounds: tuple[Array, Array], usual: Array, spread: Array, largest: Array
) -> Array:
    """Returns the motion u (3,) that minimises the sum of the module, a linear least-squares problem with bounds.

    Args:
        response: (5, 3), B.
        target: (5,), the desired B u, N.
        bounds: (5,), (5,), the bounds of B u, N.
        usual: (3,), u_0.
        spread: (3,), s_u.
        largest: (3,), largest |u|.
    """
    n = N_LOADS
    A = np.block(
        [
            [response / LOAD_TOLERANCE, np.zeros((n, n))],
            [np.diag(1.0 / spread), np.zeros((3, n))],
            [response / BOUND_TOLERANCE, -np.eye(n) / BOUND_TOLERANCE],
        ]
    )
    b = np.concatenate([target / LOAD_TOLERANCE, usual / spread, np.zeros(n)])
    unit = np.concatenate([largest, np.ones(n)])  # turns, feeds and forces differ by orders of magnitude
    limits = np.concatenate([-np.ones(3), bounds[0]]), np.concatenate([np.ones(3), bounds[1] + NARROWEST])
    found: Array = lsq_linear(A * unit, b, bounds=limits, method="bvls").x[:3] * largest
    return found
