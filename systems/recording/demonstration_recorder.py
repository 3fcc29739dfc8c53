"""Samples the fourteen channels and the operator's action."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import BasicVector, Context, DiagramBuilder, EventStatus, LeafSystem, State
from pydrake.systems.primitives import VectorLogSink

from skill.data.demonstration import ACTIONS, CHANNELS, COLUMNS
from systems.math.rotation import from_rotation_vector, rotation_vector


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

    Computes one row of a demonstration (skill/data/demonstration.py): the fourteen channels, and the probe's motion
    since
    the previous sample, expressed in P. It remembers the orientation of the peg and the pose of the probe at the
    previous sample. ``peg_state`` is that of a floating peg, ``contact_wrench`` [torque; force] on the peg about its
    tip, in W.
    """

    def __init__(self, *, period: float, X_HP_start: RigidTransform) -> None:
        super().__init__()
        self._period = period
        self._peg_state = self.DeclareVectorInputPort("peg_state", 13)
        self._contact_wrench = self.DeclareVectorInputPort("contact_wrench", 6)
        self._probe_pose = self.DeclareAbstractInputPort("probe_pose", Value[RigidTransform]())
        # [rotation vector of the peg, position and rotation vector of the probe] at the previous sample
        turn = rotation_vector(X_HP_start.rotation())
        self._previous = self.DeclareDiscreteState(np.concatenate([turn, X_HP_start.translation(), turn]))
        # Unrestricted, as the plant's own update is: at one instant discrete updates come after it, and would see the
        # plant one step later than the sample that is logged.
        self.DeclarePeriodicUnrestrictedUpdateEvent(period, 0.0, self._remember)
        self.DeclareForcedUnrestrictedUpdateEvent(self._remember)
        inputs = {self._peg_state.ticket(), self._contact_wrench.ticket(), self._probe_pose.ticket()}
        self._sample = self.DeclareVectorOutputPort(
            "sample",
            len(CHANNELS) + len(ACTIONS),
            self._calc_sample,
            {*inputs, self.discrete_state_ticket(self._previous)},
        )

    @staticmethod
    def AddToBuilder(  # noqa: D102 - documented by the class
        *, builder: DiagramBuilder, period: float, X_HP_start: RigidTransform
    ) -> tuple[DemonstrationRecorder, VectorLogSink]:
        recorder = builder.AddNamedSystem(
            "demonstration_recorder", DemonstrationRecorder(period=period, X_HP_start=X_HP_start)
        )
        log = builder.AddNamedSystem("demonstration_log", VectorLogSink(len(CHANNELS) + len(ACTIONS), period))
        builder.Connect(recorder._sample, log.get_input_port())
        return recorder, log

    @staticmethod
    def samples(log: VectorLogSink, context: Context) -> pd.DataFrame:
        """The rows that a run's log holds; ``context`` is the diagram's."""
        kept = log.FindLog(context)
        return pd.DataFrame(np.column_stack([kept.sample_times(), kept.data().T]), columns=list(COLUMNS))

    def _remember(self, context: Context, state: State) -> EventStatus:
        X_HP, X_HD = self._peg_pose(context), self._probe_pose.Eval(context)
        state.get_mutable_discrete_state(self._previous).SetFromVector(
            np.concatenate([rotation_vector(X_HP.rotation()), X_HD.translation(), rotation_vector(X_HD.rotation())])
        )
        return EventStatus.Succeeded()

    def _peg_pose(self, context: Context) -> RigidTransform:
        state = self._peg_state.Eval(context)
        return RigidTransform(RotationMatrix(Quaternion(state[:4] / np.linalg.norm(state[:4]))), state[4:7])

    def _calc_sample(self, context: Context, output: BasicVector) -> None:
        X_HP = self._peg_pose(context)
        previous = context.get_discrete_state(self._previous).value()
        output.SetFromVector(
            demonstration_sample(
                X_HP=X_HP,
                contact_wrench_W=self._contact_wrench.Eval(context),
                X_HD=self._probe_pose.Eval(context),
                R_HP_previous=from_rotation_vector(previous[0:3]),
                X_HD_previous=RigidTransform(from_rotation_vector(previous[6:9]), previous[3:6]),
            )
        )


def demonstration_sample(
    *,
    X_HP: RigidTransform,
    contact_wrench_W: NDArray[np.float64],
    X_HD: RigidTransform,
    R_HP_previous: RotationMatrix,
    X_HD_previous: RigidTransform,
) -> NDArray[np.float64]:
    """One row: the fourteen channels, then the action."""
    R_PH = X_HP.rotation().inverse()
    torque, force = np.split(contact_wrench_W, 2)
    turn = rotation_vector(X_HP.rotation())
    angle = float(np.linalg.norm(turn))
    axis = turn / angle if angle > 0 else np.array([0.0, 0.0, 1.0])
    dangle = np.linalg.norm(rotation_vector(R_HP_previous.inverse() @ X_HP.rotation()))
    moved = X_HD.translation() - X_HD_previous.translation()
    turned = rotation_vector(X_HD.rotation() @ X_HD_previous.rotation().inverse())
    return np.concatenate(
        [
            *(X_HP.translation(), R_PH @ force, R_PH @ torque, axis, [angle, dangle]),
            *(R_PH @ moved, R_PH @ turned),
        ]
    )
