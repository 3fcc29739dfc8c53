import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydrake.math import RotationMatrix
from scipy.spatial.transform import Rotation

from systems.math.rotation import free_body_pose, from_rotation_vector, rotation_between, rotation_vector

components = st.floats(-1.0, 1.0)
directions = st.tuples(components, components, components).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.1)
angles = st.one_of(st.floats(0.0, math.pi - 1e-6), st.floats(0.0, 1e-6), st.floats(math.pi - 1e-4, math.pi - 1e-6))


def unit(v):
    return v / np.linalg.norm(v)


@given(direction=directions, angle=angles)
def test_the_matrix_of_a_rotation_vector_equals_that_of_scipy(direction, angle):
    vector = unit(direction) * angle
    np.testing.assert_allclose(
        from_rotation_vector(vector).matrix(), Rotation.from_rotvec(vector).as_matrix(), atol=1e-11
    )


@given(direction=directions, angle=angles)
def test_the_rotation_vector_of_a_matrix_equals_that_of_scipy(direction, angle):
    vector = unit(direction) * angle
    R = Rotation.from_rotvec(vector)
    found = rotation_vector(RotationMatrix(R.as_matrix()))
    np.testing.assert_allclose(found, R.as_rotvec(), atol=1e-8)
    np.testing.assert_allclose(found, vector, atol=1e-7)


@given(direction=directions, angle=st.floats(1e-8, math.pi - 1e-3))
def test_conversion_to_a_matrix_and_back_is_precise_for_small_angles(direction, angle):
    vector = unit(direction) * angle
    np.testing.assert_allclose(rotation_vector(from_rotation_vector(vector)), vector, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, 0.8)])
def test_the_rotation_vector_of_half_a_turn_has_length_pi(axis):
    R = RotationMatrix(Rotation.from_rotvec(math.pi * np.array(axis)).as_matrix())
    found = rotation_vector(R)
    assert np.linalg.norm(found) == pytest.approx(math.pi)
    np.testing.assert_allclose(np.abs(found @ np.array(axis)), math.pi, rtol=1e-9)


@given(a=directions, b=directions)
def test_the_shortest_rotation_turns_one_direction_onto_the_other(a, b):
    check_shortest_rotation(unit(a), unit(b))


@given(a=directions, across=directions, angle=st.floats(0.0, 1e-3) | st.floats(0.0, 1e-11))
def test_the_shortest_rotation_between_nearly_opposite_directions_is_precise(a, across, angle):
    a = unit(a)
    normal = np.cross(a, across)
    assume(np.linalg.norm(normal) > 0.01)
    b = Rotation.from_rotvec(unit(normal) * (math.pi - angle)).apply(a)
    check_shortest_rotation(a, unit(b))


def check_shortest_rotation(a, b):
    """Checks that the rotation turns ``a`` onto ``b``, by the angle between them, without spin."""
    turn = rotation_between(a, b)
    np.testing.assert_allclose(Rotation.from_rotvec(turn).apply(a), b, atol=2e-12)
    assert np.linalg.norm(turn) == pytest.approx(2.0 * math.atan2(np.linalg.norm(a - b), np.linalg.norm(a + b)))
    assert abs(turn @ a) < 1e-9


def test_the_rotation_between_equal_directions_is_zero():
    np.testing.assert_array_equal(rotation_between(np.array([0.0, 0.6, 0.8]), np.array([0.0, 0.6, 0.8])), np.zeros(3))


@given(direction=directions, angle=angles, scale=st.floats(0.9, 1.1))
def test_the_pose_of_a_free_body_does_not_depend_on_the_norm_of_its_quaternion(direction, angle, scale):
    R = Rotation.from_rotvec(unit(direction) * angle)
    x, y, z, w = R.as_quat()
    X = free_body_pose(np.array([scale * w, scale * x, scale * y, scale * z, 0.1, -0.2, 0.3]))
    np.testing.assert_allclose(X.rotation().matrix(), R.as_matrix(), atol=1e-12)
    np.testing.assert_array_equal(X.translation(), [0.1, -0.2, 0.3])
