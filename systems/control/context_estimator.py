"""The on-line estimator of the context."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from skill.data.rig_run import CONTEXT_COLUMNS
from skill.features.measurement import measurement
from skill.features.responses import rig_observations
from skill.policy import RigPolicy
from skill.states.context_filter import ContextEstimate


def readings_of(estimate: ContextEstimate) -> list[float]:
    """Returns what a run records of an estimate, in the order of ``CONTEXT_COLUMNS``.

    The evidence is that for the most probable context, less that for the next one; 0 for a single context.
    """
    order = np.argsort(-estimate.probabilities, kind="stable")[:2]
    evidence = estimate.evidence[order[0]] - estimate.evidence[order[-1]]
    return [float(order[0]), float(estimate.probabilities[order[0]]), float(evidence)]


class ContextEstimator(LeafSystem):
    """
    .. pydrake_system::

        name: ContextEstimator
        input_ports:
        - wrench
        - depth
        - target_pitch
        - target_yaw
        output_ports:
        - contexts
        - context
        - context_probability
        - context_evidence

    Estimates the probability of each context of a policy from the wrench on the peg about its tip (N, N m, in P), the
    depth (m), and the policy's own motions: the commanded angles of the hole (rad). It runs the policy's
    `ContextFollower`. With the `ContactStateEstimator` it is the filter over pairs of contact and context.

    ``contexts`` are the probabilities. The other outputs are for records: ``context`` is the most probable one,
    ``context_probability`` its probability, and ``context_evidence`` what the measurement added to the logarithm of its
    odds against the next most probable. All use the measurement of the same instant. The discrete state is the memory
    of the follower.
    """

    def __init__(self, *, policy: RigPolicy, period: float) -> None:
        super().__init__()
        self._filter = policy.context_filter()
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        self._targets = [self.DeclareVectorInputPort(f"target_{name}", 1) for name in ("pitch", "yaw")]
        self._memory = self.DeclareDiscreteState(self._filter.initial_memory())
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
        inputs = {port.ticket() for port in (self._wrench, self._depth, *self._targets)}
        self._estimate = self.DeclareCacheEntry(
            "estimate",
            ValueProducer(self._allocate, self._calc_estimate),
            inputs | {self.discrete_state_ticket(self._memory)},
        )
        estimate = {self._estimate.ticket()}
        number = self._filter.n_contexts
        self.DeclareVectorOutputPort("contexts", number, self._calc_contexts, estimate)
        for index, name in enumerate(CONTEXT_COLUMNS):
            self.DeclareVectorOutputPort(name, 1, self._reader(index), estimate)

    def _allocate(self) -> AbstractValue:
        number = self._filter.n_contexts
        return AbstractValue.Make(
            ContextEstimate(self._filter.initial_memory(), np.full(number, 1.0 / number), np.zeros(number))
        )

    def _calc_estimate(self, context: Context, output: AbstractValue) -> None:
        measured = measurement(self._wrench.Eval(context), self._depth.Eval(context)[0])
        targets = np.array([port.Eval(context)[0] for port in self._targets])
        memory = context.get_discrete_state(self._memory).value()
        output.set_value(self._filter.step(memory, rig_observations(measured, targets)))

    def _eval_estimate(self, context: Context) -> ContextEstimate:
        estimate: ContextEstimate = self._estimate.Eval(context)
        return estimate

    def _calc_contexts(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._eval_estimate(context).probabilities)

    def _reader(self, index: int) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            output[0] = readings_of(self._eval_estimate(context))[index]

        return calc

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        discrete_state.get_mutable_vector(self._memory).SetFromVector(self._eval_estimate(context).memory)
