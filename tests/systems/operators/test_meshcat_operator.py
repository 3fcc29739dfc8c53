"""Tests the browser operator with simulated sliders and a simulated gamepad."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from systems.math.rotation import from_rotation_vector
from systems.operators.meshcat_operator import (
    IDLE,
    MAX_RATES,
    SLIDERS,
    UNITS,
    MeshcatOperator,
    SliderState,
    hand_coordinates,
    hand_pose,
)
from tests.stepping import update

PERIOD = 0.02
START = RigidTransform(from_rotation_vector(np.array([0.02, -0.01, 0.0])), [0.001, -0.002, 0.003])
LABELS = [slider[0] for slider in SLIDERS]


class Browser:
    """Replaces Meshcat; a slider rounds its value to its step, like the browser does."""

    def __init__(self):
        self.values, self.steps = {}, {}
        self.pad = SimpleNamespace(index=None, axes=[])

    def GetSliderNames(self):
        return list(self.values)

    def AddSlider(self, label, low, high, step, value, less, more):
        self.values[label], self.steps[label] = value, step

    def SetSliderValue(self, label, value):
        self.values[label] = round(value / self.steps[label]) * self.steps[label]

    def GetSliderValue(self, label):
        return self.values[label]

    def GetGamepad(self):
        return self.pad

    def push(self, **sticks):
        """Deflects the named axes of the gamepad: left_x, left_y, right_x, right_y."""
        axes = [sticks.get(name, 0.0) for name in ("left_x", "left_y", "right_x", "right_y")]
        self.pad = SimpleNamespace(index=0, axes=axes)


@pytest.fixture
def browser():
    return Browser()


def operator(browser, start=START):
    dut = MeshcatOperator(meshcat=browser, period=PERIOD, X_HD_start=start)
    return dut, dut.CreateDefaultContext()


def coordinates(dut, context):
    return hand_coordinates(dut.GetOutputPort("hand_pose").Eval(context))


def test_the_hand_starts_at_its_pose_and_the_sliders_show_it(browser):
    dut, context = operator(browser)
    X = dut.GetOutputPort("hand_pose").Eval(context)
    np.testing.assert_allclose(X.GetAsMatrix34(), START.GetAsMatrix34(), atol=1e-12)
    for label, value, slider in zip(LABELS, hand_coordinates(START) / UNITS, SLIDERS, strict=True):
        assert browser.values[label] == pytest.approx(value, abs=slider[3] / 2 + 1e-9)


def test_hand_pose_and_hand_coordinates_are_inverse():
    values = np.array([0.012, 0.03, -0.02, 0.001, -0.002])
    np.testing.assert_allclose(hand_coordinates(hand_pose(values)), values, rtol=1e-9)


@pytest.mark.parametrize("k", range(5))
def test_the_hand_follows_a_slider_at_no_more_than_its_maximum_rate(browser, k):
    dut, context = operator(browser, RigidTransform())
    browser.values[LABELS[k]] = 4.0
    before = coordinates(dut, context)
    update(dut, context, period=PERIOD)
    moved = coordinates(dut, context) - before
    assert moved[k] == pytest.approx(PERIOD * MAX_RATES[k], rel=1e-6)
    np.testing.assert_allclose(np.delete(moved, k), 0.0, atol=1e-9)
    update(dut, context, period=PERIOD, times=60)
    assert coordinates(dut, context)[k] == pytest.approx(4.0 * UNITS[k], rel=1e-6)


def test_the_pose_is_linear_in_time_between_two_readings(browser):
    dut, context = operator(browser, RigidTransform())
    browser.values[LABELS[0]] = 10.0
    update(dut, context, period=PERIOD / 2)
    half = coordinates(dut, context)[0]
    context.SetTime(PERIOD)
    assert coordinates(dut, context)[0] == pytest.approx(2.0 * half, rel=1e-9)


def test_a_stick_moves_the_target_by_less_than_a_step_of_its_slider(browser):
    """In one period the stick moves the target by 0.1 mm, a fifth of the step of the slider."""
    dut, context = operator(browser, RigidTransform())
    deflection = 0.2
    browser.push(right_y=deflection)
    update(dut, context, period=PERIOD, times=50)
    assert coordinates(dut, context)[0] == pytest.approx(50 * PERIOD * deflection * MAX_RATES[0], rel=1e-6)
    assert browser.values[LABELS[0]] == pytest.approx(5.0, abs=0.25)


def test_a_stick_stops_at_the_end_of_its_slider(browser):
    dut, context = operator(browser, RigidTransform())
    browser.push(left_x=-1.0)
    update(dut, context, period=PERIOD, times=60)
    assert coordinates(dut, context)[1] == pytest.approx(math.radians(-5.0), rel=1e-6)


def test_a_small_deflection_of_a_stick_is_ignored(browser):
    dut, context = operator(browser, RigidTransform())
    browser.push(right_y=0.9 * IDLE, left_x=-0.9 * IDLE)
    update(dut, context, period=PERIOD, times=10)
    np.testing.assert_array_equal(coordinates(dut, context), 0.0)


def test_the_state_is_recovered_from_its_list():
    values = np.arange(1.0, 22.0)
    assert SliderState.from_vector(values).as_list() == values.tolist()
