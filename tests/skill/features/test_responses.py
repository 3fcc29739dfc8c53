"""Answers to own motions: hand-worked numbers, and what must not change them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from skill.features.canonical_frame import turned_rows
from skill.features.responses import (
    HORIZON,
    ResponseFeatures,
    horizon_steps,
    observations,
    rig_observations,
)
from skill.features.wrench_features import CanonicalFeatures, RawFeatures

RADIUS = 0.01
dut = ResponseFeatures(CanonicalFeatures(), RADIUS)


def observed(force=(3.0, 0.0, 1.0), moment=(0.0, 0.0, 0.0), depth=0.002, turned=(0.0, 0.0)):
    return np.array([[*force, *moment, -depth, *turned]])


def test_an_answer_in_the_peg_frame_by_hand():
    raw = ResponseFeatures(RawFeatures(), RADIUS)
    before = observed(force=(1.0, 2.0, 3.0), moment=(0.01, 0.02, 0.0), depth=0.001, turned=(0.1, 0.2))
    after = observed(force=(1.5, 1.0, 5.0), moment=(0.02, 0.0, 0.5), depth=0.0013, turned=(0.11, 0.18))
    found = raw.between(before, after)
    np.testing.assert_allclose(found.inputs, [[0.01, -0.02, -0.0003]], atol=1e-15)
    np.testing.assert_allclose(found.outputs, [[0.5, -1.0, 1.0, -2.0, 2.0]], atol=1e-12)
    np.testing.assert_allclose(found.features, RawFeatures().fit_transform(before[:, :7]))


def test_answers_are_told_in_the_frame_of_the_first_force():
    # The force points along y, so that x of the canonical frame is y of the peg frame.
    before = observed(force=(0.0, 5.0, 0.0))
    after = observed(force=(0.0, 7.0, 0.0), turned=(0.0, 0.03))
    found = dut.between(before, after)
    np.testing.assert_allclose(found.outputs[0, :2], [2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(found.inputs[0, :2], [0.03, 0.0], atol=1e-12)


@given(angle=st.floats(-3.1, 3.1), seed=st.integers(0, 1000))
def test_turning_the_scene_about_the_axis_changes_nothing(angle, seed):
    rng = np.random.default_rng(seed)
    before, after = rng.normal(size=(2, 4, 9))
    before[:, 0] += 3.0
    turned = []
    for rows in (before, after):
        rows = rows.copy()
        for k in (0, 3, 7):
            rows[:, k : k + 2] = turned_rows(rows[:, k:], np.full(4, angle))
        turned.append(rows)
    first, second = dut.between(before, after), dut.between(*turned)
    np.testing.assert_allclose(first.inputs, second.inputs, atol=1e-9)
    np.testing.assert_allclose(first.outputs, second.outputs, atol=1e-7)
    np.testing.assert_allclose(first.features, second.features, atol=1e-9)


def test_a_horizon_is_a_whole_number_of_periods():
    assert horizon_steps(0.02) == round(HORIZON / 0.02)
    assert horizon_steps(1.0) == 1


def test_turning_the_hole_turns_the_peg_relative_to_it_the_other_way():
    measured, targets = np.arange(7.0), np.array([0.1, -0.2])
    np.testing.assert_array_equal(rig_observations(measured, targets), [*range(7), -0.1, 0.2])
    np.testing.assert_array_equal(rig_observations(measured, targets), observations(measured, -targets))
