import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex

from systems.plant.body_pose import BodyPose


def test_the_output_is_the_pose_of_the_selected_body():
    poses = [RigidTransform([float(k), 2.0 * k, -1.0 * k]) for k in range(4)]
    dut = BodyPose(BodyIndex(2))
    context = dut.CreateDefaultContext()
    dut.GetInputPort("body_poses").FixValue(context, Value[list[RigidTransform]](poses))
    np.testing.assert_array_equal(dut.GetOutputPort("pose").Eval(context).GetAsMatrix34(), poses[2].GetAsMatrix34())
