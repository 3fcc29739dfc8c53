"""The on-line estimator of what a policy acts on."""

from __future__ import annotations

from collections.abc import Callable

from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, LeafSystem, ValueProducer

from skill.features.measurement import measurement
from skill.states.estimate import Estimate, Estimator


class PolicyEstimator(LeafSystem):
    """
    .. pydrake_system::

        name: PolicyEstimator
        input_ports:
        - wrench
        - depth
        output_ports:
        - estimate
        - state
        - known

    Runs the estimator of a policy on the wrench on the peg about its tip (N, N m, in P) and the depth (m). For a skill
    this is the filter of its contact states (`StateEstimator`). A policy without estimator has an `Estimate` of one
    state, for certain.

    ``estimate`` is the `Estimate` at the measurement of the same instant. The other outputs are for records: the most
    probable state, and whether it is ``known``. The memory of the estimator is the discrete state,
    so that one system serves many contexts.
    """

    def __init__(self, *, estimator: Estimator | None, period: float) -> None:
        super().__init__()
        self._estimator = estimator
        initial = Estimate() if estimator is None else estimator.initial()
        self._wrench = self.DeclareVectorInputPort("wrench", 6)
        self._depth = self.DeclareVectorInputPort("depth", 1)
        prerequisites = {self.nothing_ticket()}
        if estimator is not None:
            self._memory = self.DeclareDiscreteState(initial.memory)
            self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._update)
            prerequisites = {self.discrete_state_ticket(self._memory), self._wrench.ticket(), self._depth.ticket()}
        self._estimate = self.DeclareCacheEntry(
            "estimate", ValueProducer(lambda: Value[object](initial), self._calc_estimate), prerequisites
        )
        found = {self._estimate.ticket()}
        self.DeclareAbstractOutputPort("estimate", lambda: Value[object](initial), self._copy_estimate, found)
        for name, read in READINGS.items():
            self.DeclareVectorOutputPort(name, 1, self._reader(read), found)

    def _calc_estimate(self, context: Context, output: Value[object]) -> None:
        if self._estimator is None:
            return
        measured = measurement(self._wrench.Eval(context), self._depth.Eval(context)[0])
        memory = context.get_discrete_state(self._memory).value()
        output.set_value(self._estimator.step(memory, measured))

    def _eval_estimate(self, context: Context) -> Estimate:
        estimate: Estimate = self._estimate.Eval(context)
        return estimate

    def _copy_estimate(self, context: Context, output: Value[object]) -> None:
        output.set_value(self._eval_estimate(context))

    def _reader(self, read: Callable[[Estimate], float]) -> Callable[[Context, BasicVector], None]:
        def calc(context: Context, output: BasicVector) -> None:
            output[0] = read(self._eval_estimate(context))

        return calc

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        discrete_state.get_mutable_vector(self._memory).SetFromVector(self._eval_estimate(context).memory)


READINGS: dict[str, Callable[[Estimate], float]] = {
    "state": lambda estimate: estimate.state,
    "known": lambda estimate: estimate.known,
}
"""The output ports for records, the columns of `skill.data.rig_run`."""
