"""The kinematics of the arm, against the published model, finite differences and statics."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant

from models.arm import FR3, UR5E
from models.scenario import load_scenario
from systems.arm.kinematics import FLANGE_TO_SENSOR, ArmKinematics, add_arm_model
from systems.arm.tip_servo import tip_at, tip_pose

Q = {FR3: [0.1, -0.7, 0.2, -2.2, 0.3, 1.6, 0.7], UR5E: [2.6, -1.2, 1.9, -2.0, -1.4, 0.4]}


@pytest.fixture(scope="module", params=[FR3, UR5E])
def scenario(request):
    return load_scenario(request.param)


@pytest.fixture(scope="module")
def kinematics(scenario):
    return ArmKinematics(scenario)


@pytest.fixture
def q(scenario):
    return np.array(Q[scenario.carrier])


def flange_of(carrier, angles):
    """Returns the pose of the flange in the frame of the base, by the tip of the peg."""
    scenario = load_scenario(carrier)
    X_WP = ArmKinematics(scenario).tip(np.array(angles))
    R_BF = X_WP.rotation() @ RotationMatrix.MakeXRotation(np.pi)
    tip = X_WP.translation() + scenario.arm.hole
    return RigidTransform(R_BF, tip - (FLANGE_TO_SENSOR + scenario.sensor.height) * R_BF.col(2))


def ur5e_by_denavit_hartenberg(angles):
    """The pose of the flange in the frame of the base by the parameters that Universal Robots publishes."""
    a, d = [0.0, -0.425, -0.3922, 0.0, 0.0, 0.0], [0.1625, 0.0, 0.0, 0.1333, 0.0997, 0.0996]
    X = RigidTransform()
    for k, alpha in enumerate((np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)):
        turn = RigidTransform(RotationMatrix.MakeZRotation(angles[k]), [0.0, 0.0, d[k]])
        X = X @ turn @ RigidTransform(RotationMatrix.MakeXRotation(alpha), [a[k], 0.0, 0.0])
    return X


def test_the_flange_of_the_fr3_is_where_the_published_model_has_it():
    """The pose of link8 of franka_description's fr3.urdf at these angles."""
    found = flange_of(FR3, Q[FR3])
    np.testing.assert_allclose(found.translation(), [0.30931, 0.152561, 0.634455], atol=2e-6)
    np.testing.assert_allclose(found.rotation().col(2), [0.041474, 0.187626, -0.981364], atol=2e-6)


def test_the_flange_of_the_ur5e_is_where_the_published_parameters_have_it():
    for angles in np.random.default_rng(0).uniform(-np.pi, np.pi, (5, 6)):
        expected = ur5e_by_denavit_hartenberg(angles).GetAsMatrix34()
        np.testing.assert_allclose(flange_of(UR5E, angles).GetAsMatrix34(), expected, atol=1e-12)


@pytest.mark.parametrize(("carrier", "mass"), [(FR3, 15.49489), (UR5E, 16.9939)])
def test_the_links_that_move_weigh_what_is_published(carrier, mass):
    plant = MultibodyPlant(0.0)
    add_arm_model(plant, load_scenario(carrier))
    plant.Finalize()
    names = [f"link{k + 1}" for k in range(len(Q[carrier]))]
    assert sum(plant.GetBodyByName(name).default_mass() for name in names) == pytest.approx(mass, abs=1e-4)


def test_over_the_hole_the_tip_moves_as_well_in_all_directions_as_that_of_the_fr3(kinematics):
    """The smallest singular value of the Jacobian: 0.22 m for the FR3."""
    J = kinematics.jacobian(kinematics.angles_at(tip_pose(np.zeros(3), tip_at(0.003))))
    assert np.linalg.svd(J, compute_uv=False).min() > 0.2


def test_the_jacobian_is_that_of_finite_differences(kinematics, q):
    step, J, X = 1e-6, kinematics.jacobian(q), kinematics.tip(q)
    for k, unit in enumerate(np.eye(len(q))):
        moved = kinematics.tip(q + step * unit)
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


def test_the_stiffness_at_the_tip_is_that_of_the_joints_by_their_levers(kinematics, q):
    """One joint at the lever a gives k/a^2; compliances of joints add."""
    found, J = kinematics.stiffness(q, 1000.0), kinematics.jacobian(q)
    assert found[5] == pytest.approx(1.0 / sum(lever**2 / 1000.0 for lever in J[5]))
    assert kinematics.stiffness(q, 2000.0)[5] == pytest.approx(2.0 * found[5])
