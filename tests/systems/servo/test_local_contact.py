"""The local model of the contact: its vector, its joined springs, and that they carry the contact's force."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import LeafSystem

from models.scenario import DEMONSTRATION_STREAM, load_scenario, resolve_scenario
from systems.math.rotation import from_rotation_vector
from systems.servo.local_contact import MAX_SPRINGS, LocalContact, Springs
from systems.servo.probe import Probe
from systems.servo.served_environment import MakeServedEnvironment
from systems.servo.servo_diagram import MakeServo
from systems.virtual_environment import start_pose


class Held(LeafSystem):
    """A hand that holds the device at a pose."""

    def __init__(self, X_HD):
        super().__init__()
        self.DeclareAbstractOutputPort("hand_pose", lambda: Value(X_HD), lambda _, output: output.set_value(X_HD))


def random_springs(n, seed=0):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Springs(rng.normal(size=(n, 3)), normals, rng.uniform(1.0, 2.0, n), rng.normal(size=n))


@given(st.integers(0, MAX_SPRINGS), st.integers(0, 1000))
def test_a_model_survives_its_vector(n, seed):
    rng = np.random.default_rng(seed)
    X_HP = RigidTransform(from_rotation_vector(rng.uniform(-1.0, 1.0, 3)), rng.normal(size=3))
    model = LocalContact(rng.uniform(), X_HP, rng.normal(size=6), random_springs(n, seed))
    vector = model.as_vector()
    again = LocalContact.from_vector(vector)
    assert vector.shape == (LocalContact.SIZE,)
    assert again.time == model.time
    assert again.X_HP.IsNearlyEqualTo(X_HP, 1e-12)
    for name in ("points", "normals", "stiffnesses", "forces"):
        np.testing.assert_array_equal(getattr(again.springs, name), getattr(model.springs, name))
    np.testing.assert_array_equal(again.V_HP, model.V_HP)


def test_faces_are_joined_by_the_direction_in_which_they_push():
    """Forces are powers of two, so that a sum names its parts."""
    up, down, inward = [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [-0.9, 0.0, math.sqrt(1.0 - 0.9**2)]
    faces = [
        ([0.010, 0.001, 0.0], up),
        ([0.001, 0.010, 0.0], up),  # in the same quadrant
        ([-0.010, 0.001, 0.0], up),
        ([0.010, 0.001, 0.0], down),  # at the same place
        ([0.010, 0.001, -0.001], inward),  # 26 degrees above the plane: the bore's
        ([0.010, 0.001, -0.002], [-1.0, 0.0, 0.0]),  # in the same half of the height
        ([0.010, 0.001, -0.012], [-1.0, 0.0, 0.0]),  # in the lower half
    ]
    points, normals = (np.array([face[k] for face in faces]) for k in (0, 1))
    joined = Springs(points, normals, np.ones(len(faces)), 2.0 ** np.arange(len(faces))).joined()
    assert sorted(joined.forces) == [1 + 2, 4, 8, 16 + 32, 64]
    assert joined.stiffnesses.sum() == len(faces)
    np.testing.assert_allclose(np.linalg.norm(joined.normals, axis=1), 1.0)


TWO_PINS = [[-0.0095, 0.0, 0.004, 0.0, 0.0], [0.0095, 0.0, 0.004, 0.0, 0.0]]
CORNERS = [[1.0, -1.0, 0.1], [1.0, 1.0, 0.1], [-1.0, 1.0, 0.1], [-1.0, -1.0, 0.1]]


@pytest.mark.parametrize("shape", [{}, {"section": "square"}, {"corners": CORNERS}, {"mates": TWO_PINS}])
def test_the_exact_engine_presses_the_floor_with_the_springs_and_the_hand_feels_its_part(shape):
    """A peg at the floor under a probe 2 mm below the floor: the coupling's stiffness times 2 mm is on the springs."""
    scenario = load_scenario("device")
    scenario.contact.engine, scenario.start.depth = "exact", scenario.geometry.hole_depth - 1e-4
    for name, value in shape.items():
        setattr(scenario.geometry, name, value)
    scenario.start.tilt, scenario.rig.pivot_height = [0.0, 0.0], 0.0
    scenario = resolve_scenario(scenario, seed=3, stream=DEMONSTRATION_STREAM)
    environment, X = MakeServedEnvironment(scenario), start_pose(scenario)
    simulator = Simulator(environment.diagram)
    context = simulator.get_mutable_context()
    environment.set_start(context)
    below = RigidTransform(X.translation() - [0.0, 0.0, 1e-4 + 0.002])
    environment.set_probe(context, Probe(0.0, below, np.zeros(6), np.zeros(6), 0.0, 0.0, -2.5e-3, 1.0, 0.0))
    assert environment.min_energy(context) == -2.5e-3
    simulator.AdvanceTo(0.6)
    springs = environment.local_contact(context, 0.6).springs
    pressing = springs.forces > 0.0
    expected = 0.002 * scenario.coupling.stiffness
    assert 3 <= pressing.sum() <= len(springs.forces) <= MAX_SPRINGS
    force = springs.forces[pressing] @ springs.normals[pressing]
    # The floor holds a square at three of its four corners, which change by turns: by up to 0.2 N here.
    np.testing.assert_allclose(force, [0.0, 0.0, expected], atol=0.3)
    np.testing.assert_array_equal(springs.stiffnesses, scenario.contact.stiffness)

    servo = MakeServo(scenario, operator=Held(below), X_HP_start=X)
    servo.start(X)
    for _ in range(300):
        servo.set_contact(environment.local_contact(context, servo.time))
        servo.tick()
    felt = scenario.coupling.force_scale * expected
    np.testing.assert_allclose(servo.probe().wrench, [0.0, 0.0, 0.0, 0.0, 0.0, felt], atol=0.01)
