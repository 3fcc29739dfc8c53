import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RotationMatrix

from models.scenario import Scenario
from systems.haptics.virtual_fixture import axial_deviation, fixture_of, rig_deviation
from systems.math.rotation import from_rotation_vector

tilts = st.tuples(st.floats(-0.15, 0.15), st.floats(-0.15, 0.15))


def test_a_free_peg_has_no_deviation_and_an_axial_one_has_its_own():
    X_HP = RigidTransform([0.001, -0.002, 0.003])
    assert fixture_of(Scenario(fixture="free"))(X_HP) is None
    assert fixture_of(Scenario(fixture="axial")) is axial_deviation


@given(
    tilt=tilts,
    height=st.floats(-0.03, 0.01),
    pivot=st.floats(-0.003, 0.003),
    distance=st.floats(-0.005, 0.005),
    direction=st.floats(0.0, 2 * math.pi),
)
def test_the_rigs_deviation_is_the_distance_of_the_axis_from_the_pivot(tilt, height, pivot, distance, direction):
    R, p_HPivot = from_rotation_vector(np.array([*tilt, 0.0])), np.array([0.0, 0.0, pivot])
    across = distance * (math.cos(direction) * R.col(0) + math.sin(direction) * R.col(1))
    found = rig_deviation(RigidTransform(R, p_HPivot + (height - pivot) * R.col(2) + across), pivot_height=pivot)
    np.testing.assert_allclose(found.d_HQ, across, atol=1e-14)
    np.testing.assert_array_equal(found.p_HQ, p_HPivot)


@given(tilt=tilts, spin=st.floats(-0.2, 0.2))
def test_the_rigs_deviation_contains_the_spin_of_a_tilted_peg_about_its_axis(tilt, spin):
    R = from_rotation_vector(np.array([*tilt, 0.0])) @ RotationMatrix.MakeZRotation(spin)
    theta = rig_deviation(RigidTransform(R, np.zeros(3))).theta_H
    # This is exact to first order in the spin; the remainder is of order tilt^2.
    np.testing.assert_allclose(theta, spin * R.col(2), atol=abs(spin) * (0.15**2 * 2) + 1e-12)


def test_a_clocking_stage_leaves_the_angle_about_the_axis_to_the_hand():
    R = from_rotation_vector(np.array([0.03, -0.02, 0.0])) @ RotationMatrix.MakeZRotation(0.05)
    scenario, X_HP = Scenario(fixture="rig"), RigidTransform(R, [1e-4, 0.0, 0.0])
    scenario.rig.pivot_height = 0.001
    held = fixture_of(scenario)(X_HP)
    scenario.rig.clocking_stage = True
    found = fixture_of(scenario)(X_HP)
    np.testing.assert_array_equal(found.theta_H, np.zeros(3))
    assert found.guides_rotation.shape == (0, 3)
    np.testing.assert_array_equal(found.d_HQ, held.d_HQ)
    np.testing.assert_array_equal(found.p_HQ, [0.0, 0.0, 0.001])
    assert held.theta_H @ R.col(2) == pytest.approx(0.05, rel=1e-3)


def test_the_axial_fixture_leaves_the_slide_along_the_axis_only():
    X = RigidTransform(from_rotation_vector(np.array([0.02, -0.03, 0.01])), [0.001, -0.002, 0.003])
    found = axial_deviation(X)
    np.testing.assert_allclose(found.d_HQ, [0.001, -0.002, 0.0])
    np.testing.assert_allclose(found.p_HQ, [0.001, -0.002, 0.003])
    np.testing.assert_allclose(found.theta_H, [0.02, -0.03, 0.01])
    np.testing.assert_array_equal(found.free_axis_H, [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(found.guides_rotation, np.eye(3))
