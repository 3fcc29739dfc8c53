"""The trained classifier, on line."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from skill.states.contact_state_filter import Estimate
from systems.control.policy import RigPolicy


class ContactStateEstimator(LeafSystem):
    """
    .. pydrake_system::

        name: ContactStateEstimator
        input_ports:
        - wrench
        - depth
        output_ports:
        - probabilities
        - state
        - known

    The probability of each contact state, from the wrench on the peg about its tip (N, N m, in P) and the depth (m):
    the forward recursion of a hidden Markov model whose emissions are the skill's Gaussians, marginalised over the
    features that the rig cannot measure, and whose transitions are those of the demonstrations (see
    `ContactStateFilter`). The belief is the system's discrete state, so one system serves many contexts.

    ``state`` is the most probable one; ``known`` is 1 where the measurement lies within its gate. The outputs use this
    instant's measurement, not the last period's.
    """

    def __init__(self, *, skill: RigPolicy, period: float) -> None:
        super().__init__()
        self._skill = skill
        self._filter = skill.state_filter()
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._belief = self.DeclareDiscreteState(self._filter.initial_log_belief())
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        needed = {self._wrench.ticket(), self._depth.ticket(), self.discrete_state_ticket(self._belief)}
        self._estimate = self.DeclareCacheEntry(
            "estimate", ValueProducer(lambda: Value[object](None), self._calc_estimate), needed
        )
        cached = {self._estimate.ticket()}
        self.DeclareVectorOutputPort("probabilities", skill.n_states, self._calc_probabilities, cached)
        self.DeclareVectorOutputPort("state", 1, self._calc_state, cached)
        self.DeclareVectorOutputPort("known", 1, self._calc_known, cached)

    def _calc_estimate(self, context: Context, output: Value) -> None:
        measured = np.array([*self._wrench.Eval(context), -self._depth.Eval(context)[0]])
        belief = context.get_discrete_state(self._belief).value()
        output.set_value(self._filter.step(belief, self._skill.measured_features(measured)))

    def _estimated(self, context: Context) -> Estimate:
        estimate: Estimate = self._estimate.Eval(context)
        return estimate

    def _calc_probabilities(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._estimated(context).probabilities)

    def _calc_state(self, context: Context, output: BasicVector) -> None:
        output[0] = float(np.argmax(self._estimated(context).probabilities))

    def _calc_known(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self._estimated(context).known)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        discrete_state.get_mutable_vector(self._belief).SetFromVector(self._estimated(context).log_belief)
