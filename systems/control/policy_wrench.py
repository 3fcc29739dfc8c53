"""What stands between the measured wrench and the policy where the policy is not to receive it as it is."""

from __future__ import annotations

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, NumericParameterIndex
from scipy.special import ndtr

from skill.arrays import Array
from systems.math.noise import standard_normal
from systems.steps.policy_wrench import initial_state, policy_wrench, policy_wrench_step

SHUFFLING = "shuffled wrench"
"""Name of the random numbers."""


class PolicyWrench(LeafSystem):
    """
    .. pydrake_system::

        name: PolicyWrench
        input_ports:
        - wrench
        output_ports:
        - policy_wrench

    Replaces the measured wrench (N, N m) for the policy and its estimator by `policy_wrench`, with a reading in each
    period. All that guards the peg goes on with the measured wrench.

    Args:
        use: `ControllerParameters.wrench`, but not ``true``.
        period: of the controller, s.
        lever: of the moments in a load, m.
        seed: of the scenario; `set_seed` replaces it in a context.
    """

    def __init__(self, *, use: str, period: float, lever: float, seed: int) -> None:
        super().__init__()
        self._use, self._period, self._lever = use, period, lever
        self._seed = NumericParameterIndex(self.DeclareNumericParameter(BasicVector([float(seed)])))
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._state = self.DeclareDiscreteState(initial_state(use))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        own = {self.discrete_state_ticket(self._state), self.numeric_parameter_ticket(self._seed)}
        self.DeclareVectorOutputPort("policy_wrench", 6, self._calc, {*own, self._wrench.ticket()})

    def set_seed(self, context: Context, seed: int) -> None:
        """Replaces the seed in ``context``, which is this system's."""
        context.get_mutable_numeric_parameter(self._seed).SetFromVector([float(seed)])

    def _values(self, context: Context) -> Array:
        return np.array(context.get_discrete_state(self._state).value())

    def _chances(self, context: Context, number: float) -> Array:
        """Two numbers, uniform in (0, 1), for the reading with this number."""
        seed = int(context.get_numeric_parameter(self._seed)[0])
        chances: Array = ndtr(standard_normal(seed, SHUFFLING, int(number), 2))
        return chances

    def _calc(self, context: Context, output: BasicVector) -> None:
        state = self._values(context)
        chance = self._chances(context, state[0])[0]
        output.SetFromVector(policy_wrench(self._use, state, self._wrench.Eval(context), chance))

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = self._values(context)
        chance = self._chances(context, state[0])[1]
        found = policy_wrench_step(self._use, state, self._wrench.Eval(context), chance, self._lever)
        discrete_state.set_value(self._state, found)
