"""The on-line estimator of the contact state."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from skill.features.measurement import measurement
from skill.policy import RigPolicy
from skill.states.contact_state_filter import Estimate


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

    Estimates the probability of each contact state from the wrench on the peg about its tip (N, N m, in P) and the
    depth (m). It runs the policy's `StateFollower`. For a skill this is the forward recursion of a hidden Markov model
    (`ContactStateFilter`): the emissions are the skill's Gaussians, marginalised over the features that the rig cannot
    measure, and the transitions are those of the demonstrations. The belief is the discrete state of the system, so
    one system serves many contexts.

    ``state`` is the most probable state. ``known`` is 1 if the measurement lies within the gate of that state. The
    outputs use the measurement of the same instant.
    """

    def __init__(self, *, policy: RigPolicy, period: float) -> None:
        super().__init__()
        self._policy = policy
        self._filter = policy.state_filter()
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._belief = self.DeclareDiscreteState(self._filter.initial_log_belief())
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        prerequisites = {self._wrench.ticket(), self._depth.ticket(), self.discrete_state_ticket(self._belief)}
        self._estimate = self.DeclareCacheEntry(
            "estimate", ValueProducer(self._allocate_estimate, self._calc_estimate), prerequisites
        )
        estimate = {self._estimate.ticket()}
        self.DeclareVectorOutputPort("probabilities", policy.n_states, self._calc_probabilities, estimate)
        self.DeclareVectorOutputPort("state", 1, self._calc_state, estimate)
        self.DeclareVectorOutputPort("known", 1, self._calc_known, estimate)

    def _allocate_estimate(self) -> AbstractValue:
        belief = self._filter.initial_log_belief()
        return AbstractValue.Make(Estimate(belief, np.exp(belief), mahalanobis=np.inf, known=False))

    def _calc_estimate(self, context: Context, output: AbstractValue) -> None:
        measured = measurement(self._wrench.Eval(context), self._depth.Eval(context)[0])
        belief = context.get_discrete_state(self._belief).value()
        output.set_value(self._filter.step(belief, self._policy.measured_features(measured)))

    def _eval_estimate(self, context: Context) -> Estimate:
        estimate: Estimate = self._estimate.Eval(context)
        return estimate

    def _calc_probabilities(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._eval_estimate(context).probabilities)

    def _calc_state(self, context: Context, output: BasicVector) -> None:
        output[0] = float(np.argmax(self._eval_estimate(context).probabilities))

    def _calc_known(self, context: Context, output: BasicVector) -> None:
        output[0] = float(self._eval_estimate(context).known)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        discrete_state.get_mutable_vector(self._belief).SetFromVector(self._eval_estimate(context).log_belief)
