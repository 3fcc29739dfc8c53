"""Observes the energy at the probe, to detect energy that the haptic display generates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem, State

from systems.math.rotation import from_rotation_vector, rotation_vector


@dataclass(frozen=True)
class ObserverState:
    """State of the observer; `as_list` and `from_vector` convert it to and from a discrete state (14,).

    Attributes:
        energy: Energy that the hand has put in, J.
        lowest: Minimum of the energy so far, J.
        position: Position of the probe at the last update (3,), in H, m.
        turn: Rotation vector of the probe at the last update (3,), in H, rad.
        wrench: Rendered wrench held since the last update (6,): torque (N m), then force (N).
    """

    energy: float
    lowest: float
    position: NDArray[np.float64]
    turn: NDArray[np.float64]
    wrench: NDArray[np.float64]

    @classmethod
    def from_vector(cls, v: NDArray[np.float64]) -> ObserverState:
        """The inverse of `as_list`."""
        return cls(energy=v[0], lowest=v[1], position=v[2:5], turn=v[5:8], wrench=v[8:14])

    def as_list(self) -> list[float]:
        """[energy, lowest, *position, *turn, *wrench]."""
        return [self.energy, self.lowest, *self.position.tolist(), *self.turn.tolist(), *self.wrench.tolist()]


class PassivityObserver(LeafSystem):
    """
    .. pydrake_system::

        name: PassivityObserver
        input_ports:
        - probe_pose
        - rendered_wrench
        output_ports:
        - energy

    Integrates the energy that the hand puts into the display. The wrench [t; f] on the hand is constant over a servo
    period, in which the probe moves by dx and turns by the rotation vector dr, so that

        E_k+1 = E_k - f_k . dx_k - t_k . dr_k

    is exact. A passive display returns at most the energy that was put in: E >= 0. ``energy`` is [E, minimum of E so
    far] in J. ``probe_pose`` is X_HD; ``rendered_wrench`` is [torque; force] in H.

    Args:
        period: Servo period, s.
        X_HD_start: Pose of the probe at the start.
    """

    def __init__(self, *, period: float, X_HD_start: RigidTransform) -> None:
        super().__init__()
        self._probe_pose = self.DeclareAbstractInputPort("probe_pose", Value[RigidTransform]())
        self._rendered_wrench = self.DeclareVectorInputPort("rendered_wrench", 6)
        start = ObserverState(
            energy=0.0,
            lowest=0.0,
            position=X_HD_start.translation(),
            turn=rotation_vector(X_HD_start.rotation()),
            wrench=np.zeros(6),
        )
        self._state = self.DeclareDiscreteState(start.as_list())
        # An unrestricted update, like the plant's: it reads the pose and the wrench of the last period. A discrete
        # update would be evaluated after the plant's step.
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._update)
        self.DeclareForcedUnrestrictedUpdateEvent(self._update)
        self._energy = self.DeclareVectorOutputPort(
            "energy", 2, self._calc_energy, {self.discrete_state_ticket(self._state)}
        )

    def _update(self, context: Context, state: State) -> EventStatus:
        old = ObserverState.from_vector(context.get_discrete_state(self._state).value())
        X_HD = self._probe_pose.Eval(context)
        turn = rotation_vector(X_HD.rotation())
        moved = X_HD.translation() - old.position
        if turn.tolist() == old.turn.tolist():  # at rest the turn repeats; lists compare faster
            turned = np.zeros(3)
        else:
            turned = rotation_vector(X_HD.rotation() @ from_rotation_vector(old.turn).inverse())
        energy = old.energy - old.wrench[3:] @ moved - old.wrench[:3] @ turned
        new = ObserverState(
            energy=energy,
            lowest=min(old.lowest, energy),
            position=X_HD.translation(),
            turn=turn,
            wrench=self._rendered_wrench.Eval(context),
        )
        state.get_mutable_discrete_state(self._state).SetFromVector(new.as_list())
        return EventStatus.Succeeded()

    def _calc_energy(self, context: Context, output: BasicVector) -> None:
        state = ObserverState.from_vector(context.get_discrete_state(self._state).value())
        output.SetFromVector([state.energy, state.lowest])
