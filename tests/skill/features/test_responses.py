"""Answers to own motions: hand-worked numbers, and what must not change them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skill.features.canonical_frame import turned_rows
from skill.features.responses import (
    HORIZON,
    MAX_DEPTH,
    MIN_LOAD,
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


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({}, True),
        ({"force": (0.9 * MIN_LOAD, 0.0, 0.0)}, False),
        ({"force": (0.0, 0.0, 0.0), "moment": (1.1 * MIN_LOAD * RADIUS, 0.0, 0.0)}, True),
        ({"depth": 1.01 * MAX_DEPTH * RADIUS}, False),
        ({"depth": 0.99 * MAX_DEPTH * RADIUS}, True),
    ],
)
def test_only_loaded_samples_near_the_mouth_are_informative(change, expected):
    assert dut.informative(observed(**change))[0] == expected


def test_a_series_gives_the_answers_a_horizon_apart():
    steps = horizon_steps(0.02)
    assert steps == round(HORIZON / 0.02)
    rows = np.vstack([observed(force=(2.0 + k, 0.0, 0.0), turned=(0.0, 1e-3 * k)) for k in range(8)])
    rows[1, 0] = 0.1  # free
    found = dut.of_series(rows, 0.02)
    np.testing.assert_allclose(found.outputs[:, 0], [5.0, 5.0])
    np.testing.assert_allclose(found.inputs[:, 1], [5e-3, 5e-3])


@pytest.mark.parametrize("number", [0, 1, 5])
def test_a_short_series_has_no_answers(number):
    found = dut.of_series(np.zeros((number, 9)), 0.02)
    assert found.inputs.shape == (0, 3)
    assert found.outputs.shape == (0, 5)
    assert len(found.features) == 0


def test_turning_the_hole_turns_the_peg_relative_to_it_the_other_way():
    measured, targets = np.arange(7.0), np.array([0.1, -0.2])
    np.testing.assert_array_equal(rig_observations(measured, targets), [*range(7), -0.1, 0.2])
    np.testing.assert_array_equal(rig_observations(measured, targets), observations(measured, -targets))
