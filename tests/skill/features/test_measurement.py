import numpy as np
import pytest

from skill.features.measurement import (
    contact_load,
    load_of_components,
    measurement,
    observations,
    rig_observations,
)

WRENCH = np.array([3.0, 4.0, 12.0, 0.03, 0.04, 0.0])


def test_a_measurement_is_the_wrench_and_the_height_of_the_tip():
    np.testing.assert_array_equal(measurement(WRENCH, 0.005), [*WRENCH, -0.005])
    rows = measurement(np.array([WRENCH, 2 * WRENCH]), np.array([0.005, -0.001]))
    np.testing.assert_array_equal(rows, [[*WRENCH, -0.005], [*(2 * WRENCH), 0.001]])


def test_the_load_is_the_norm_of_force_and_moment_over_the_peg_radius():
    assert contact_load(WRENCH, 0.01) == pytest.approx(np.hypot(13.0, 5.0))
    assert contact_load(np.array([*WRENCH, 99.0]), 0.01) == contact_load(WRENCH, 0.01)  # ignores further elements


def test_the_load_of_six_floats_is_that_of_the_array():
    wrench = [3.0, -4.0, 12.0, 0.03, 0.04, -0.07]
    assert load_of_components(*wrench, 0.01) == pytest.approx(contact_load(np.array(wrench), 0.01), rel=1e-14)
    assert load_of_components(*[0.0] * 6, 0.01) == 0.0


def test_turning_the_hole_turns_the_peg_relative_to_it_the_other_way():
    measured, targets = np.arange(7.0), np.array([0.1, -0.2])
    np.testing.assert_array_equal(rig_observations(measured, targets), [*range(7), -0.1, 0.2])
    np.testing.assert_array_equal(rig_observations(measured, targets), observations(measured, -targets))
