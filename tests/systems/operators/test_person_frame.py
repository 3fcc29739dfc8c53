import math

import numpy as np
import pytest

from systems.operators.person_frame import R_HV, hand_coordinates, hand_pose


def test_hand_coordinates_inverts_hand_pose():
    rng = np.random.default_rng(0)
    for _ in range(20):
        coordinates = rng.uniform(-1, 1, 5) * [0.02, 0.08, 0.08, 0.003, 0.003]
        np.testing.assert_allclose(hand_coordinates(hand_pose(coordinates)), coordinates, atol=1e-12)


@pytest.mark.parametrize(
    ("coordinates", "axis", "tip"),
    [
        ([0.01, 0, 0, 0, 0], [0, 0, 1], [0, 0, -0.01]),
        ([0, 0.05, 0, 0, 0], [np.sin(0.05), 0, np.cos(0.05)], [0, 0, 0]),  # to the right
        ([0, 0, 0.05, 0, 0], [0, np.sin(0.05), np.cos(0.05)], [0, 0, 0]),  # away
        ([0, 0, 0, 0.002, 0.001], [0, 0, 1], [0.002, 0.001, 0]),
    ],
)
def test_hand_moves_in_the_directions_that_the_person_sees(coordinates, axis, tip):
    X_HD = hand_pose(np.array(coordinates, dtype=float))
    np.testing.assert_allclose(R_HV.inverse() @ X_HD.rotation().col(2), axis, atol=1e-12)
    np.testing.assert_allclose(R_HV.inverse() @ X_HD.translation(), tip, atol=1e-12)


def test_the_frame_of_the_person_is_seen_from_the_corner_of_the_cutaway():
    """Right is (-1, 1) / sqrt(2) in the x-y plane of H, away is (-1, -1) / sqrt(2)."""
    half = math.sqrt(0.5)
    np.testing.assert_allclose(R_HV.matrix(), [[-half, -half, 0.0], [half, -half, 0.0], [0.0, 0.0, 1.0]], atol=1e-12)
    X = hand_pose(np.array([0.01, 0.0, 0.0, 0.001, 0.0]))
    np.testing.assert_allclose(X.translation(), [-0.001 * half, 0.001 * half, -0.01], atol=1e-12)
