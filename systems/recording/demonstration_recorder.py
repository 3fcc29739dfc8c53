"""Records the fourteen channels of a demonstration and the action of the operator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
import pandas as pd
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import BasicVector, Context, EventStatus, LeafSystem, State
from pydrake.systems.primitives import VectorLogSink

from skill.arrays import Array
from skill.data.demonstration import ACTIONS, CHANNELS, COLUMNS
from systems.math.rotation import free_body_pose, from_rotation_vector, rotation_vector


@dataclass(frozen=True)
class PreviousSample:
    """What a sample needs from the one before it.

    Attributes:
        R_HP: orientation of the peg.
        X_HD: pose of the probe.
    """

    R_HP: RotationMatrix
    X_HD: RigidTransform

    def as_vector(self) -> Array:
        """Returns (9,): rotation vector of the peg, position and rotation vector of the probe."""
        return np.concatenate(
            [rotation_vector(self.R_HP), self.X_HD.translation(), rotation_vector(self.X_HD.rotation())]
        )

    @classmethod
    def from_vector(cls, values: Array) -> Self:
        """Inverts `as_vector`."""
        peg_turn, probe_position, probe_turn = np.split(values, 3)
        return cls(from_rotation_vector(peg_turn), RigidTransform(from_rotation_vector(probe_turn), probe_position))


class DemonstrationRecorder(LeafSystem):
    """
    .. pydrake_system::

        name: DemonstrationRecorder
        input_ports:
        - peg_state
        - contact_wrench
        - probe_pose
        output_ports:
        - sample

    Computes one row of a demonstration (`skill.data.demonstration`): the fourteen channels, and the motion of the probe
    since the previous sample, expressed in P. The discrete state is the `PreviousSample`. ``peg_state`` is the state of
    a floating peg, ``contact_wrench`` the [torque; force] on the peg about its tip, in W.
    """

    def __init__(self, *, period: float, X_HP_start: RigidTransform) -> None:
        super().__init__()
        self._peg_state = self.DeclareVectorInputPort("peg_state", 13)
        self._contact_wrench = self.DeclareVectorInputPort("contact_wrench", 6)
        self._probe_pose = self.DeclareAbstractInputPort("probe_pose", Value[RigidTransform]())
        start = PreviousSample(X_HP_start.rotation(), X_HP_start)
        self._previous = self.DeclareDiscreteState(start.as_vector())
        # The update is unrestricted, like that of the plant. A discrete update at the same instant would come after
        # the plant's, and would see the plant one step later than the logged sample does.
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._store_sample)
        self.DeclareForcedUnrestrictedUpdateEvent(self._store_sample)
        inputs = {self._peg_state.ticket(), self._contact_wrench.ticket(), self._probe_pose.ticket()}
        self._sample = self.DeclareVectorOutputPort(
            "sample",
            len(CHANNELS) + len(ACTIONS),
            self._calc_sample,
            {*inputs, self.discrete_state_ticket(self._previous)},
        )

    @staticmethod
    def samples(log: VectorLogSink, context: Context) -> pd.DataFrame:
        """Returns the rows of a run, with the columns ``COLUMNS``; ``context`` is the diagram's."""
        rows = log.FindLog(context)
        return pd.DataFrame(np.column_stack([rows.sample_times(), rows.data().T]), columns=list(COLUMNS))

    def _store_sample(self, context: Context, state: State) -> EventStatus:
        sample = PreviousSample(self._peg_pose(context).rotation(), self._probe_pose.Eval(context))
        state.get_mutable_discrete_state(self._previous).SetFromVector(sample.as_vector())
        return EventStatus.Succeeded()

    def _peg_pose(self, context: Context) -> RigidTransform:
        return free_body_pose(self._peg_state.Eval(context)[:7])

    def _calc_sample(self, context: Context, output: BasicVector) -> None:
        previous = PreviousSample.from_vector(context.get_discrete_state(self._previous).value())
        output.SetFromVector(
            demonstration_sample(
                X_HP=self._peg_pose(context),
                contact_wrench_W=self._contact_wrench.Eval(context),
                X_HD=self._probe_pose.Eval(context),
                R_HP_previous=previous.R_HP,
                X_HD_previous=previous.X_HD,
            )
        )


UPRIGHT = 1e-12
"""Angle below which the peg counts as upright, rad: the squares of a far smaller turn underflow, and with them the
length of its axis."""


def demonstration_sample(
    *,
    X_HP: RigidTransform,
    contact_wrench_W: Array,
    X_HD: RigidTransform,
    R_HP_previous: RotationMatrix,
    X_HD_previous: RigidTransform,
) -> Array:
    """Computes one row: the fourteen channels (`CHANNELS`), then the action (`ACTIONS`).

    Args:
        X_HP: pose of the peg.
        contact_wrench_W: (6,), torque (N m), then force (N), on the peg about its tip, in W.
        X_HD: pose of the probe.
        R_HP_previous: orientation of the peg at the previous sample.
        X_HD_previous: pose of the probe at the previous sample.
    """
    R_PH = X_HP.rotation().inverse()
    torque, force = np.split(contact_wrench_W, 2)
    turn = rotation_vector(X_HP.rotation())
    angle = float(np.linalg.norm(turn))
    if angle < UPRIGHT:
        angle, axis = 0.0, np.array([0.0, 0.0, 1.0])
    else:
        axis = turn / angle
    dangle = np.linalg.norm(rotation_vector(R_HP_previous.inverse() @ X_HP.rotation()))
    moved = X_HD.translation() - X_HD_previous.translation()
    turned = rotation_vector(X_HD.rotation() @ X_HD_previous.rotation().inverse())
    return np.concatenate(
        [
            *(X_HP.translation(), R_PH @ force, R_PH @ torque, axis, [angle, dangle]),
            *(R_PH @ moved, R_PH @ turned),
        ]
    )
