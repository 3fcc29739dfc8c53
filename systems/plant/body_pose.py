"""Selects the pose of one body from the poses of all bodies."""

from __future__ import annotations

from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, LeafSystem


class BodyPose(LeafSystem):
    """
    .. pydrake_system::

        name: BodyPose
        input_ports:
        - body_poses
        output_ports:
        - pose

    Outputs X_WB of one body of a MultibodyPlant, from the plant's ``body_poses`` port.

    Args:
        body: Index of the body in the plant.
    """

    def __init__(self, body: BodyIndex) -> None:
        super().__init__()
        self._body = int(body)
        self._poses = self.DeclareAbstractInputPort("body_poses", AbstractValue.Make([RigidTransform()]))
        self.DeclareAbstractOutputPort("pose", Value[RigidTransform], self._calc, {self._poses.ticket()})

    def _calc(self, context: Context, output: Value) -> None:
        output.set_value(self._poses.Eval(context)[self._body])
