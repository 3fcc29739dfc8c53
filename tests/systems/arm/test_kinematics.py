"""The kinematics of the arm, against the published model, finite differences and statics."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from models.scenario import load_scenario
from systems.arm.kinematics import FLANGE_TO_SENSOR, ArmKinematics
from systems.arm.tip_servo import tip_at, tip_pose

S = load_scenario("fr3")
Q = np.array([0.1, -0.7, 0.2, -2.2, 0.3, 1.6, 0.7])


@pytest.fixture(scope="module")
def kinematics():
    return ArmKinematics(S)


def test_the_flange_is_where_the_published_model_has_it(kinematics):
    """The pose of link8 of franka_description's fr3.urdf at these angles; the tip is further along its z axis."""
    flange_z, flange = np.array([0.041474, 0.187626, -0.981364]), np.array([0.30931, 0.152561, 0.634455])
    expected = flange + (FLANGE_TO_SENSOR + S.sensor.height) * flange_z - S.arm.hole
    np.testing.assert_allclose(kinematics.tip(Q).translation(), expected, atol=2e-6)
    np.testing.assert_allclose(kinematics.tip(Q).rotation().col(2), -flange_z, atol=2e-6)


def test_the_jacobian_is_that_of_finite_differences(kinematics):
    step, J, X = 1e-6, kinematics.jacobian(Q), kinematics.tip(Q)
    for k in range(7):
        moved = kinematics.tip(Q + step * np.eye(7)[k])
        np.testing.assert_allclose((moved.translation() - X.translation()) / step, J[3:, k], atol=1e-5)
        skew = (moved.rotation() @ X.rotation().inverse()).matrix() / step
        np.testing.assert_allclose([skew[2, 1], skew[0, 2], skew[1, 0]], J[:3, k], atol=1e-5)


@pytest.mark.parametrize(("angles", "height"), [((0.0, 0.0, 0.0), 0.003), ((0.06, -0.05, 0.0), -0.02)])
def test_angles_are_found_for_a_pose(kinematics, angles, height):
    X = tip_pose(np.array(angles), tip_at(height))
    found = kinematics.tip(kinematics.angles_at(X))
    np.testing.assert_allclose(found.GetAsMatrix34(), X.GetAsMatrix34(), atol=1e-9)


def test_a_hole_out_of_reach_is_named(kinematics):
    with pytest.raises(ValueError, match=r"the arm does not reach the point .* place the hole elsewhere"):
        kinematics.angles_at(RigidTransform([0.9, 0.0, 0.0]))


def test_the_stiffness_at_the_tip_is_that_of_the_joints_by_their_levers(kinematics):
    """One joint at the lever a gives k/a^2; compliances of joints add."""
    found, J = kinematics.stiffness(Q, 1000.0), kinematics.jacobian(Q)
    assert found[5] == pytest.approx(1.0 / sum(lever**2 / 1000.0 for lever in J[5]))
    assert kinematics.stiffness(Q, 2000.0)[5] == pytest.approx(2.0 * found[5])
