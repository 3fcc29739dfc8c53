"""One tick of the local peg against hand-worked formulas."""

import numpy as np
import pytest
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import BodyIndex

from models.scenario import Scenario
from systems.math.rotation import from_rotation_vector, rotation_vector
from systems.servo.local_contact import LocalContact, Springs
from systems.servo.local_peg import CORRECTION, SLIP_SPEED, LocalPeg

H = 1e-3
NOTHING = np.zeros(6)
S = Scenario()
MASS, INERTIA = S.coupling.peg_mass, S.coupling.peg_inertia
START = RigidTransform(from_rotation_vector(np.array([0.02, -0.01, 0.0])), [1e-3, 2e-3, 5e-3])


@pytest.fixture
def peg():
    return LocalPeg(scenario=S, period=H, X_HP_start=START)


def spring(normal, *, force, stiffness=1e5, point=(0.0, 0.0, 0.0)):
    return Springs(np.array([point]), np.array([normal], dtype=float), np.array([stiffness]), np.array([force]))


def next_velocity(peg, V, F, springs, moved=NOTHING):
    return peg.next_velocity(np.array(V, dtype=float), np.array(F, dtype=float), springs, moved, np.zeros(3))


def test_a_free_peg_follows_newton(peg):
    V = next_velocity(peg, [0.1, 0, 0, 0, 0, 0.2], [0.3, 0, 0, 0, 4.0, 0], Springs.none())
    np.testing.assert_allclose(V, [0.1 + H * 0.3 / INERTIA, 0, 0, 0, H * 4.0 / MASS, 0.2])


def test_a_spring_pushes_only(peg):
    V = next_velocity(peg, np.zeros(6), np.zeros(6), spring([0, 0, 1], force=-1.0))
    np.testing.assert_array_equal(V, 0.0)
    # A gap that the peg closes within the tick, and a displacement that opens the contact.
    V = next_velocity(peg, [0, 0, 0, 0, 0, -0.05], np.zeros(6), spring([0, 0, 1], force=-1.0))
    assert V[5] > -0.05
    moved = np.array([0, 0, 0, 0, 0, 3e-5])  # 3 N at 1e5 N/m
    np.testing.assert_array_equal(next_velocity(peg, np.zeros(6), np.zeros(6), spring([0, 0, 1], force=2.0), moved), 0)


def test_dissipation_is_that_of_hunt_and_crossley(peg):
    k, f, v, d = 1e5, 2.0, 0.01, S.contact.dissipation
    V = next_velocity(peg, [0, 0, 0, 0, 0, v], np.zeros(6), spring([0, 0, 1], force=f, stiffness=k))
    assert V[5] == pytest.approx((MASS * v + H * f) / (MASS + H * H * k + H * d * f))


def test_a_squeezed_peg_rests(peg):
    """200 N from both sides, as in a wedge: explicit dissipation would throw the peg from one side to the other."""
    sides = Springs(np.zeros((2, 3)), np.array([[1.0, 0, 0], [-1.0, 0, 0]]), np.full(2, 2.8e7), np.full(2, 200.0))
    V, x = np.array([0, 0, 0, 0.01, 0, 0]), np.zeros(6)
    for _ in range(20):
        V = peg.next_velocity(V, np.zeros(6), sides, x, np.zeros(3))
        x = x + H * V
    np.testing.assert_allclose(V, 0.0, atol=1e-6)


def test_a_spring_beside_the_tip_turns_the_peg(peg):
    V = next_velocity(peg, np.zeros(6), np.zeros(6), spring([0, 0, 1], force=2.0, stiffness=1.0, point=(0.01, 0, 0)))
    assert V[1] == pytest.approx(-0.01 * H * 2.0 / INERTIA, rel=0.02)  # (r x f)_y = -x f_z; a little dissipation
    assert V[5] == pytest.approx(H * 2.0 / MASS, rel=0.02)


def test_friction_slows_by_its_coefficient_times_the_normal_force(peg):
    v, f = 0.05, 2.0
    V = next_velocity(peg, [0, 0, 0, v, 0, 0], np.zeros(6), spring([0, 0, 1], force=f, stiffness=1.0))
    assert V[3] == pytest.approx(v / (1.0 + H * S.contact.friction * f / v / MASS))
    slow = 0.1 * SLIP_SPEED
    V = next_velocity(peg, [0, 0, 0, slow, 0, 0], np.zeros(6), spring([0, 0, 1], force=f, stiffness=1.0))
    assert V[3] == pytest.approx(slow / (1.0 + H * S.contact.friction * f / SLIP_SPEED / MASS))


def advance(peg, context, model, force=NOTHING):
    applied = ExternallyAppliedSpatialForce()
    applied.body_index, applied.F_Bq_W = BodyIndex(1), SpatialForce(tau=force[:3], f=force[3:])
    peg.GetInputPort("peg_forces").FixValue(context, Value([applied]))
    peg.GetInputPort("contact").FixValue(context, Value(model))
    state = peg.EvalUniquePeriodicDiscreteUpdate(context)
    context.SetTime(context.get_time() + H)
    context.get_mutable_discrete_state().SetFrom(state)
    return peg.GetOutputPort("peg_state").Eval(context)


def test_a_new_model_moves_the_peg_evenly_to_where_the_simulation_is(peg):
    """The difference is divided over the ticks of CORRECTION: no step is larger than its part."""
    context = peg.CreateDefaultContext()
    shift, turn = np.array([1e-4, 0.0, -2e-4]), np.array([1e-3, 0.0, 0.0])
    there = RigidTransform(from_rotation_vector(turn) @ START.rotation(), START.translation() + shift)
    model = LocalContact(H, there, np.zeros(6), Springs.none())
    ticks = round(CORRECTION / H)
    before = START.translation()
    for _ in range(ticks):
        now = advance(peg, context, model)[4:7]
        np.testing.assert_allclose(now - before, shift / ticks, atol=1e-12)
        before = now
    state = advance(peg, context, model)
    np.testing.assert_allclose(state[4:7], there.translation(), atol=1e-12)
    np.testing.assert_allclose(rotation_vector(rotation(state) @ there.rotation().inverse()), 0.0, atol=1e-9)
    np.testing.assert_allclose(state[7:], 0.0, atol=1e-12)


def rotation(state):
    return RotationMatrix(Quaternion(state[:4]))


def test_the_motion_of_an_old_model_is_carried_on_to_the_present(peg):
    context, V = peg.CreateDefaultContext(), np.array([0.2, -0.1, 0.0, 0.0, 0.03, -0.02])
    model = LocalContact(0.5 * H, START, V, Springs.none())
    ticks = round(CORRECTION / H)
    first = advance(peg, context, model)
    turned = rotation_vector(rotation(first) @ START.rotation().inverse())
    moved = first[4:7] - START.translation()
    np.testing.assert_allclose([*turned, *moved], 0.5 * H * V / ticks, atol=1e-12)  # half a period later, its part
    np.testing.assert_allclose(first[7:], V / ticks, atol=1e-12)


def test_friction_follows_the_normal_force_that_the_motion_leaves(peg):
    """The peg moves into the spring: within the tick its force grows from 2 N by k h v."""
    v, f, k, into = 0.05, 2.0, 100.0, 0.02
    V = next_velocity(peg, [0, 0, 0, v, 0, -into], np.zeros(6), spring([0, 0, 1], force=f, stiffness=k))
    damping = S.contact.friction * (f + H * k * into) / v
    assert V[3] == pytest.approx(v / (1.0 + H * damping / MASS), rel=1e-12)
