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
    R_HV,
    SLIDERS,
    UNITS,
    MeshcatOperator,
    SliderState,
    add_sliders,
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
        self.values, self.steps, self.ranges, self.keys = {}, {}, {}, {}
        self.pad = SimpleNamespace(index=None, axes=[])

    def GetSliderNames(self):
        return list(self.values)

    def AddSlider(self, label, low, high, step, value, less, more):
        assert label not in self.values
        self.values[label], self.steps[label] = value, step
        self.ranges[label], self.keys[label] = (low, high), (less, more)

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


def test_the_sliders_have_their_ranges_steps_and_keys_and_begin_at_zero(browser):
    """In mm and degrees. The label names the keys: W feeds, the arrow to the right tilts to the right, and so on."""
    add_sliders(browser, np.zeros(5))
    assert list(browser.ranges.values()) == [(-10, 40), (-5, 5), (-5, 5), (-5, 5), (-5, 5)]
    assert list(browser.steps.values()) == [0.5, 0.1, 0.1, 0.05, 0.05]
    assert list(browser.values.values()) == [0.0] * 5
    arrows = {"←": "ArrowLeft", "→": "ArrowRight", "↓": "ArrowDown", "↑": "ArrowUp"}
    for label, keys in browser.keys.items():
        named = label[label.index("(") + 1 : -1].split()
        assert keys == tuple(arrows.get(key, f"Key{key}") for key in named)


def test_sliders_are_added_once_and_set_every_time(browser):
    for depth in (0.002, 0.005):
        add_sliders(browser, np.array([depth, math.radians(1.0), math.radians(-2.0), 0.001, -0.003]))
        assert list(browser.values.values()) == pytest.approx([1e3 * depth, 1.0, -2.0, 1.0, -3.0])


def test_sliders_begin_at_zero_before_they_are_set():
    class Unset(Browser):
        def SetSliderValue(self, label, value):
            pass

    browser = Unset()
    add_sliders(browser, np.ones(5))
    assert list(browser.values.values()) == [0.0] * 5


def test_sliders_show_millimetres_and_degrees(browser):
    dut, context = operator(browser, RigidTransform())
    for label, value in zip(LABELS, [4.0, 3.0, 2.0, 1.0, -1.0], strict=True):
        browser.values[label] = value
    update(dut, context, period=PERIOD, times=100)
    found = coordinates(dut, context)
    np.testing.assert_allclose(found, [0.004, math.radians(3.0), math.radians(2.0), 0.001, -0.001], rtol=1e-6)


def test_the_hand_feeds_25_mm_tilts_8_degrees_and_moves_10_mm_in_a_second(browser):
    dut, context = operator(browser, RigidTransform())
    for label in LABELS:
        browser.values[label] = -5.0
    update(dut, context, period=PERIOD)  # 0.02 s
    expected = [-0.0005, -math.radians(0.16), -math.radians(0.16), -0.0002, -0.0002]
    np.testing.assert_allclose(coordinates(dut, context), expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("stick", "slider", "sign"), [("right_y", 0, 1.0), ("left_x", 1, 1.0), ("left_y", 2, -1.0), ("right_x", None, 0.0)]
)
@pytest.mark.parametrize("deflection", [0.5, -0.5])
def test_the_right_stick_feeds_and_the_left_stick_tilts(browser, stick, slider, sign, deflection):
    """Down is positive on a gamepad: right stick down feeds, left stick up tilts away."""
    dut, context = operator(browser, RigidTransform())
    browser.push(**{stick: deflection})
    update(dut, context, period=PERIOD, times=10)
    expected = np.zeros(5)
    if slider is not None:
        expected[slider] = 0.2 * sign * deflection * [0.025, math.radians(8.0), math.radians(8.0)][slider]
    np.testing.assert_allclose(coordinates(dut, context), expected, atol=1e-12)


@pytest.mark.parametrize(("deflection", "moves"), [(0.11, False), (0.13, True), (-0.11, False), (-0.13, True)])
def test_a_stick_works_from_12_percent_of_its_deflection(browser, deflection, moves):
    dut, context = operator(browser, RigidTransform())
    browser.push(left_y=deflection)
    update(dut, context, period=PERIOD, times=10)
    assert (coordinates(dut, context) != 0.0).any() == moves


@pytest.mark.parametrize(("index", "number", "moves"), [(None, 4, False), (0, 3, False), (0, 4, True), (1, 6, True)])
def test_only_a_connected_gamepad_with_two_sticks_is_used(browser, index, number, moves):
    dut, context = operator(browser, RigidTransform())
    browser.pad = SimpleNamespace(index=index, axes=[0.5] * number)
    update(dut, context, period=PERIOD, times=10)
    assert (coordinates(dut, context) != 0.0).any() == moves


def test_a_slider_that_is_moved_replaces_the_target_of_a_stick(browser):
    dut, context = operator(browser, RigidTransform())
    browser.push(right_y=0.5)
    update(dut, context, period=PERIOD, times=10)
    browser.push()
    browser.values[LABELS[0]] = 1.0
    update(dut, context, period=PERIOD, times=50)
    assert coordinates(dut, context)[0] == pytest.approx(0.001)


def test_the_frame_of_the_person_is_seen_from_the_corner_of_the_cutaway():
    """Right is (-1, 1) / sqrt(2) in the x-y plane of H, away is (-1, -1) / sqrt(2)."""
    half = math.sqrt(0.5)
    np.testing.assert_allclose(R_HV.matrix(), [[-half, -half, 0.0], [half, -half, 0.0], [0.0, 0.0, 1.0]], atol=1e-12)
    X = hand_pose(np.array([0.01, 0.0, 0.0, 0.001, 0.0]))
    np.testing.assert_allclose(X.translation(), [-0.001 * half, 0.001 * half, -0.01], atol=1e-12)


def test_the_sliders_are_read_once_per_period_from_the_start(browser):
    dut, _ = operator(browser)
    timing = dut.GetUniquePeriodicDiscreteUpdateAttribute()
    assert (timing.period_sec(), timing.offset_sec()) == (PERIOD, 0.0)


def test_the_state_is_recovered_from_its_list():
    values = np.arange(1.0, 22.0)
    assert SliderState.from_vector(values).as_list() == values.tolist()
