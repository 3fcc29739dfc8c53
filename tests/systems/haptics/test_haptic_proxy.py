import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from scipy.spatial.transform import Rotation

from models.scenario import CouplingParameters
from systems.haptics.haptic_proxy import HapticProxy
from systems.haptics.virtual_fixture import axial_deviation, rig_deviation
from systems.math.rotation import from_rotation_vector
from tests.stepping import fixed_context

C = CouplingParameters()
PEG = BodyIndex(3)


def free(X_HP):
    return None


def pose(turn, position):
    return RigidTransform(from_rotation_vector(np.asarray(turn, dtype=float)), position)


def peg_state(X, V=(0.0,) * 6):
    q = X.rotation().ToQuaternion()
    return np.concatenate([[q.w(), q.x(), q.y(), q.z()], X.translation(), V])


def proxy(fixture, *, X_HD=None, V_HD=(0.0,) * 6, X_HP=None, V_HP=(0.0,) * 6):
    X_HD, X_HP = X_HD or RigidTransform(), X_HP or RigidTransform()
    dut = HapticProxy(coupling=C, fixture=fixture, peg=PEG)
    return dut, fixed_context(dut, probe_pose=X_HD, probe_velocity=list(V_HD), peg_state=peg_state(X_HP, V_HP))


def test_the_force_is_that_of_a_spring_and_a_damper():
    p_HD, p_HP = np.array([0.003, -0.001, 0.002]), np.array([0.001, 0.001, -0.004])
    v_HD, v_HP = np.array([0.01, 0.0, -0.02]), np.array([0.0, 0.03, -0.01])
    dut, context = proxy(
        free,
        X_HD=pose([0, 0, 0], p_HD),
        V_HD=[0, 0, 0, *v_HD],
        X_HP=pose([0, 0, 0], p_HP),
        V_HP=[0, 0, 0, *v_HP],
    )
    wrench = dut.GetOutputPort("coupling_wrench").Eval(context)
    np.testing.assert_allclose(
        wrench[3:],
        [
            C.stiffness * 0.002 + C.damping * 0.01,
            C.stiffness * -0.002 + C.damping * -0.03,
            C.stiffness * 0.006 + C.damping * -0.01,
        ],
    )
    np.testing.assert_allclose(wrench[:3], np.zeros(3), atol=1e-12)


def test_the_torque_is_along_the_rotation_vector_between_probe_and_peg():
    R_HP = Rotation.from_rotvec([0.2, -0.1, 0.3])
    between = np.array([0.05, 0.04, -0.03])  # of D relative to P, in H
    R_HD = Rotation.from_rotvec(between) * R_HP
    w_HD, w_HP = np.array([0.1, -0.2, 0.0]), np.array([0.0, 0.1, 0.3])
    dut, context = proxy(
        free,
        X_HD=pose(R_HD.as_rotvec(), [0, 0, 0]),
        V_HD=[*w_HD, 0, 0, 0],
        X_HP=pose(R_HP.as_rotvec(), [0, 0, 0]),
        V_HP=[*w_HP, 0, 0, 0],
    )
    np.testing.assert_allclose(
        dut.GetOutputPort("coupling_wrench").Eval(context)[:3],
        C.angular_stiffness * between + C.angular_damping * (w_HD - w_HP),
        rtol=1e-9,
    )


def test_the_probe_receives_the_scaled_reaction_and_the_peg_the_wrench():
    X_HD, X_HP = pose([0.02, 0.01, -0.03], [0.001, 0.002, -0.003]), pose([0.0, 0.03, 0.01], [0.0, -0.001, 0.001])
    dut, context = proxy(free, X_HD=X_HD, X_HP=X_HP, V_HP=[0.1, 0.2, 0.3, 0.01, 0.02, 0.03])
    wrench = dut.GetOutputPort("coupling_wrench").Eval(context)
    assert (np.abs(wrench) > 1e-3).all()
    rendered = dut.GetOutputPort("probe_wrench").Eval(context)
    np.testing.assert_allclose(rendered[:3], -C.torque_scale * wrench[:3])
    np.testing.assert_allclose(rendered[3:], -C.force_scale * wrench[3:])
    (force,) = dut.GetOutputPort("peg_forces").Eval(context)
    assert force.body_index == PEG
    np.testing.assert_array_equal(force.p_BoBq_B, np.zeros(3))  # the peg's origin is its tip
    np.testing.assert_allclose(force.F_Bq_W.rotational(), wrench[:3])
    np.testing.assert_allclose(force.F_Bq_W.translational(), wrench[3:])


def test_the_guide_acts_on_the_peg_and_not_on_the_probe():
    X = pose([0.0, 0.0, 0.0], [0.0005, 0.0, -0.01])
    dut, context = proxy(rig_deviation, X_HD=X, X_HP=X)
    (force,) = dut.GetOutputPort("peg_forces").Eval(context)
    np.testing.assert_allclose(force.F_Bq_W.translational(), [-C.guide_stiffness * 0.0005, 0.0, 0.0], atol=1e-9)
    # The force acts at the mouth, 10 mm above the tip, which gives a torque about y.
    np.testing.assert_allclose(force.F_Bq_W.rotational(), [0.0, -C.guide_stiffness * 0.0005 * 0.01, 0.0], atol=1e-9)
    np.testing.assert_array_equal(dut.GetOutputPort("probe_wrench").Eval(context), np.zeros(6))


# guides

small = st.floats(-0.1, 0.1)
speeds = st.floats(-0.5, 0.5)


def guide(fixture, X, V=(0.0,) * 6):
    dut = HapticProxy(coupling=C, fixture=fixture, peg=PEG)
    return dut.guide_wrench(X_HP=X, V_HP=np.asarray(V, dtype=float))


@given(tilt=st.tuples(small, small), height=st.floats(-0.03, 0.01), w=st.tuples(speeds, speeds), slide=speeds)
def test_the_rigs_guide_exerts_no_wrench_for_motions_of_the_rig(tilt, height, w, slide):
    R = from_rotation_vector(np.array([*tilt, 0.0]))
    X = RigidTransform(R, height * R.col(2))
    omega = w[0] * R.col(0) + w[1] * R.col(1)  # rotation about the mouth without spin
    V = np.concatenate([omega, np.cross(omega, X.translation()) + slide * R.col(2)])
    np.testing.assert_allclose(guide(rig_deviation, X, V), np.zeros(6), atol=1e-7)


@given(position=st.tuples(*[st.floats(-1e-3, 1e-3)] * 3), slide=speeds)
def test_the_axial_guide_exerts_no_force_along_the_axis(position, slide):
    X = pose([0.01, -0.02, 0.03], position)
    still, moving = guide(axial_deviation, X), guide(axial_deviation, X, [0, 0, 0, 0, 0, slide])
    np.testing.assert_allclose(still, moving, atol=1e-9)
    assert still[5] == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("fixture", [rig_deviation, axial_deviation], ids=["rig", "axial"])
@given(data=st.data())
def test_a_guide_is_a_spring_and_dissipates_power(fixture, data):
    turn = data.draw(st.tuples(*[st.floats(-0.05, 0.05)] * 3))
    position = data.draw(st.tuples(*[st.floats(-1e-3, 1e-3)] * 3))
    V = np.array(data.draw(st.tuples(*[speeds] * 6)))
    X = pose(turn, position)
    found = fixture(X)
    elastic = guide(fixture, X)
    # The spring's force at the guided point is -k d, its torque about that point -k_r theta.
    lever = found.p_HQ - X.translation()
    np.testing.assert_allclose(elastic[3:], -C.guide_stiffness * found.d_HQ, atol=1e-9)
    np.testing.assert_allclose(
        elastic[:3] - np.cross(lever, elastic[3:]), -C.angular_stiffness * found.theta_H, atol=1e-9
    )
    # The damper takes power from every motion.
    assert (guide(fixture, X, V) - elastic) @ V <= 1e-9
