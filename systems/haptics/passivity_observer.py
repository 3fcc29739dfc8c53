"""Watches the probe's port for energy that the display creates."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiagramBuilder, EventStatus, LeafSystem, State
from pydrake.systems.primitives import VectorLogSink

from systems.math.rotation import from_rotation_vector, rotation_vector

ENERGY, LOWEST, POSITION, TURN, WRENCH = 0, 1, slice(2, 5), slice(5, 8), slice(8, 14)


class PassivityObserver(LeafSystem):
    """
    .. pydrake_system::

        name: PassivityObserver
        input_ports:
        - probe_pose
        - rendered_wrench
        output_ports:
        - energy

    The energy that the hand has put into the display. The wrench [t; f] is held over a servo period while the probe
    moves by dx and turns by the rotation vector dr, so that

        E_k+1 = E_k - f_k . dx_k - t_k . dr_k

    is exact. A passive display never gives more than it got: E >= 0. ``energy`` is [E, the lowest E so far], in J.
    """

    def __init__(self, *, period: float, X_HD_start: RigidTransform) -> None:
        super().__init__()
        self._probe_pose = self.DeclareAbstractInputPort("probe_pose", Value[RigidTransform]())
        self._rendered_wrench = self.DeclareVectorInputPort("rendered_wrench", 6)
        start = np.zeros(14)
        start[POSITION], start[TURN] = X_HD_start.translation(), rotation_vector(X_HD_start.rotation())
        self._state = self.DeclareDiscreteState(start)
        # Unrestricted, as the plant's own update is: it sees the pose and the wrench that have held since the last
        # tick, not the plant after its step.
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)
        self.DeclareForcedUnrestrictedUpdateEvent(self._update)
        self._energy = self.DeclareVectorOutputPort(
            "energy",
            2,
            lambda context, output: output.SetFromVector(context.get_discrete_state(self._state).value()[:2]),
            {self.discrete_state_ticket(self._state)},
        )

    @staticmethod
    def AddToBuilder(  # noqa: D102 - documented by the class
        *, builder: DiagramBuilder, period: float, log_period: float, X_HD_start: RigidTransform
    ) -> tuple[PassivityObserver, VectorLogSink]:
        observer = builder.AddNamedSystem("passivity_observer", PassivityObserver(period=period, X_HD_start=X_HD_start))
        log = builder.AddNamedSystem("energy_log", VectorLogSink(2, log_period))
        builder.Connect(observer._energy, log.get_input_port())
        return observer, log

    def _update(self, context: Context, state: State) -> EventStatus:
        old = context.get_discrete_state(self._state).value()
        X_HD = self._probe_pose.Eval(context)
        turn = rotation_vector(X_HD.rotation())
        moved = X_HD.translation() - old[POSITION]
        if np.array_equal(turn, old[TURN]):
            turned = np.zeros(3)
        else:
            turned = rotation_vector(X_HD.rotation() @ from_rotation_vector(old[TURN]).inverse())
        energy = old[ENERGY] - old[WRENCH][3:] @ moved - old[WRENCH][:3] @ turned
        state.get_mutable_discrete_state(self._state).SetFromVector(
            np.concatenate(
                [
                    [energy, min(old[LOWEST], energy)],
                    X_HD.translation(),
                    turn,
                    self._rendered_wrench.Eval(context),
                ]
            )
        )
        return EventStatus.Succeeded()
