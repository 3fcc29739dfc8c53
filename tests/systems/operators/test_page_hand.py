"""The hand of the page with the real controls of the page, whose events come as frames of a browser."""

import math

import numpy as np
import pytest
import umsgpack
from pydrake.math import RigidTransform

from interfaces.live.controls import LiveControls
from interfaces.live.messages import Outbox
from systems.math.rotation import from_rotation_vector
from systems.operators.page_hand import (
    HIGH,
    LOW,
    MAX_RATES,
    MAX_STEP,
    SETTLING_TIME,
    SLIDERS,
    UNITS,
    PageHand,
    PageInput,
    stick_rates,
)
from systems.operators.person_frame import hand_coordinates

TICK = 1e-3
START = RigidTransform(from_rotation_vector(np.array([0.02, -0.01, 0.0])), [0.001, -0.002, 0.003])
LABELS = [slider[0] for slider in SLIDERS]
BROWSER = 1


class Person:
    """A person at the page and the hand that follows, both on a clock that `wait` moves."""

    def __init__(self, X_HD=None):
        self.now, self.written = 0.0, []
        self.controls = LiveControls(Outbox())
        self.input = PageInput(self.controls, self.written.append)
        self.hand = PageHand(self.newest, clock=lambda: self.now)
        self.input.start(X_HD or RigidTransform())
        self.hand.read_pose()

    def newest(self):
        values = self.written[-1] if self.written else None
        self.written.clear()
        return values

    def event(self, **content):
        self.controls.receive(umsgpack.packb(content), BROWSER)

    def slide(self, k, value):
        self.event(type="slider", name=LABELS[k], value=value)

    def push(self, **sticks):
        """Deflects the named axes of the gamepad: left_x, left_y, right_x, right_y."""
        axes = [sticks.get(name, 0.0) for name in ("left_x", "left_y", "right_x", "right_y")]
        self.event(type="gamepad", name="", gamepad={"index": 0, "axes": axes})

    def wait(self, seconds):
        """Returns the coordinates of the hand after a time."""
        for _ in range(round(seconds / TICK)):
            self.now += TICK
            self.hand.read_pose()
        return hand_coordinates(self.hand.read_pose())


def test_the_hand_starts_exactly_at_its_pose_and_the_sliders_show_it():
    person = Person(START)
    np.testing.assert_allclose(person.hand.read_pose().GetAsMatrix34(), START.GetAsMatrix34(), atol=1e-12)
    for label, value, slider in zip(LABELS, hand_coordinates(START) / UNITS, SLIDERS, strict=True):
        assert person.controls.GetSliderValue(label) == pytest.approx(value, abs=slider[3] / 2 + 1e-9)
    person.wait(0.1)  # the rounded values of the sliders do not move it
    np.testing.assert_allclose(person.hand.read_pose().GetAsMatrix34(), START.GetAsMatrix34(), atol=1e-12)


@pytest.mark.parametrize(
    ("k", "rate"), [(0, 0.025), (1, math.radians(8.0)), (2, math.radians(8.0)), (3, 0.010), (4, 0.010)]
)
def test_the_hand_follows_a_slider_at_no_more_than_its_maximum_rate(k, rate):
    person = Person()
    person.slide(k, 4.0)
    moved = person.wait(0.01)
    assert moved[k] == pytest.approx(0.01 * rate, rel=1e-6)
    np.testing.assert_allclose(np.delete(moved, k), 0.0, atol=1e-9)
    assert person.wait(1.2)[k] == pytest.approx(4.0 * UNITS[k], rel=1e-6)


def test_a_near_target_is_approached_without_a_jump():
    """Within 20 ms e-fold: after one tick a twentieth of the way."""
    person = Person()
    person.slide(3, 0.05)
    assert person.wait(TICK)[3] == pytest.approx(0.05e-3 * TICK / SETTLING_TIME, rel=1e-6)
    assert person.wait(SETTLING_TIME - TICK)[3] == pytest.approx(0.05e-3 * (1.0 - math.exp(-1.0)), rel=0.02)


def test_a_pause_without_readings_moves_the_hand_by_little():
    person = Person()
    person.slide(0, 40.0)
    person.now += 5.0  # the machine slept
    assert hand_coordinates(person.hand.read_pose())[0] == pytest.approx(MAX_STEP * MAX_RATES[0])


def test_a_stick_moves_the_hand_by_less_than_a_step_of_its_slider():
    """In 20 ms the stick moves the hand by 0.1 mm, a fifth of the step of the slider."""
    person = Person()
    person.push(right_y=0.2)
    found = person.wait(1.0)
    assert found[0] == pytest.approx(0.2 * MAX_RATES[0] * (1.0 - SETTLING_TIME), rel=2e-3)  # behind by the settling
    person.input.follow(person.hand.read_pose())
    assert person.controls.GetSliderValue(LABELS[0]) == pytest.approx(5.0, abs=0.25)
    person.push()
    found = person.wait(0.5)  # what `follow` has shown is no wish of the person
    assert found[0] == pytest.approx(0.2 * MAX_RATES[0], rel=1e-3)


def test_a_stick_stops_at_the_end_of_its_slider():
    person = Person()
    person.push(left_x=-1.0)
    assert person.wait(1.2)[1] == pytest.approx(LOW[1], rel=1e-6)
    person.push(left_x=1.0)
    assert person.wait(2.0)[1] == pytest.approx(HIGH[1], rel=1e-6)


@pytest.mark.parametrize(
    ("stick", "slider", "sign"), [("right_y", 0, 1.0), ("left_x", 1, 1.0), ("left_y", 2, -1.0), ("right_x", None, 0.0)]
)
@pytest.mark.parametrize("deflection", [0.5, -0.5])
def test_the_right_stick_feeds_and_the_left_stick_tilts(stick, slider, sign, deflection):
    """Down is positive on a gamepad: right stick down feeds, left stick up tilts away."""
    person = Person()
    person.push(**{stick: deflection})
    expected = np.zeros(5)
    if slider is not None:
        expected[slider] = sign * deflection * [0.025, math.radians(8.0), math.radians(8.0)][slider]
    np.testing.assert_allclose(stick_rates(person.controls.GetGamepad()), expected, atol=1e-12)
    np.testing.assert_allclose(np.sign(np.round(person.wait(0.2), 9)), np.sign(expected))


@pytest.mark.parametrize(
    ("axes", "moves"), [([0.11] * 4, False), ([-0.13] * 4, True), ([0.5] * 3, False), ([0.5] * 6, True)]
)
def test_a_gamepad_with_two_sticks_works_from_12_percent_of_their_deflection(axes, moves):
    person = Person()
    person.event(type="gamepad", name="", gamepad={"index": 0, "axes": axes})
    assert (person.wait(0.2) != 0.0).any() == moves


def test_a_gamepad_that_is_disconnected_stops_the_hand():
    person = Person()
    person.push(right_y=1.0)
    before = person.wait(0.2)[0]
    person.event(type="gamepad", name="", gamepad={})
    assert person.wait(0.5)[0] == pytest.approx(before, abs=1.1 * SETTLING_TIME * MAX_RATES[0])


def test_a_key_pressed_after_the_start_counts_and_one_before_it_does_not():
    person = Person()
    person.slide(0, 5.0)
    person.input.start(RigidTransform())
    assert person.wait(0.5)[0] == 0.0
    person.input.start(RigidTransform())
    person.slide(0, 2.0)  # before the hand has looked
    assert person.wait(0.5)[0] == pytest.approx(0.002)


def test_the_sliders_have_their_ranges_steps_and_keys():
    """In mm and degrees. The label names the keys: W feeds, the arrow to the right tilts to the right, and so on."""
    outbox = Outbox()
    PageInput(LiveControls(outbox), lambda values: None)
    shown = [umsgpack.unpackb(message) for message in outbox.since(0)[1]]
    assert [s["name"] for s in shown] == LABELS
    assert [(s["min"], s["max"]) for s in shown] == [(-10, 40), (-5, 5), (-5, 5), (-5, 5), (-5, 5)]
    assert [s["step"] for s in shown] == [0.5, 0.1, 0.1, 0.05, 0.05]
    arrows = {"←": "ArrowLeft", "→": "ArrowRight", "↓": "ArrowDown", "↑": "ArrowUp"}
    for s in shown:
        named = s["name"][s["name"].index("(") + 1 : -1].split()
        assert (s["keycode1"], s["keycode2"]) == tuple(arrows.get(key, f"Key{key}") for key in named)
