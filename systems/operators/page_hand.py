"""The hand of a person at the page: sliders, keys and gamepad move it, in the servo's process."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from pydrake.math import RigidTransform

from skill.arrays import Array
from systems.operators.person_frame import hand_coordinates, hand_pose

PAGE = "page"
"""Name of the driver of this hand."""

# Label, minimum, maximum, step, keys to decrease and increase; in millimetres and degrees for display.
SLIDERS = (
    ("depth mm (S W)", -10.0, 40.0, 0.5, "KeyS", "KeyW"),
    ("tilt right ° (← →)", -5.0, 5.0, 0.1, "ArrowLeft", "ArrowRight"),
    ("tilt away ° (↓ ↑)", -5.0, 5.0, 0.1, "ArrowDown", "ArrowUp"),
    ("right mm (J L)", -5.0, 5.0, 0.05, "KeyJ", "KeyL"),
    ("away mm (K I)", -5.0, 5.0, 0.05, "KeyK", "KeyI"),
)
UNITS = np.array([1e-3, math.radians(1.0), math.radians(1.0), 1e-3, 1e-3])
LOW, HIGH = (UNITS * np.array([slider[k] for slider in SLIDERS]) for k in (1, 2))
MAX_RATES = np.array([0.025, math.radians(8.0), math.radians(8.0), 0.010, 0.010])  # of the hand, in m/s and rad/s
SETTLING_TIME = 0.02  # in units of s, in which the hand approaches a near target
MAX_STEP = 0.02  # in units of s; longest time between two readings that the hand moves
IDLE = 0.12  # share of a stick's full deflection below which a deflection is ignored
# Slider, axis of a standard gamepad (right stick down, left stick right, left stick down), and sign.
STICKS = ((0, 3, 1.0), (1, 0, 1.0), (2, 1, -1.0))


class Sticks(Protocol):
    """State of a gamepad."""

    @property
    def index(self) -> int | None:
        """Number of the gamepad; None if there is none."""

    @property
    def axes(self) -> tuple[float, ...]:
        """Deflection of each axis, from -1 to 1."""


class HandControls(Protocol):
    """The controls of the page that move the hand; see `interfaces.live.controls.LiveControls`."""

    def AddSlider(
        self, name: str, low: float, high: float, step: float, value: float, decrement_key: str, increment_key: str
    ) -> None:
        """Adds a slider and its keys."""

    def GetSliderValue(self, name: str) -> float:
        """Returns the value of a slider."""

    def SetSliderValue(self, name: str, value: float) -> None:
        """Moves a slider."""

    def slider_moves(self, name: str) -> int:
        """Returns how often a person has moved a slider."""

    def GetGamepad(self) -> Sticks:
        """Returns the state of the gamepad."""

    def call_after_motion(self, callback: Callable[[], None]) -> None:
        """Has a function called, in another thread, after each event of a slider or gamepad."""


@dataclass(frozen=True)
class HandInput:
    """What the person wants of the hand. Arrays have one element for each slider, in m and rad.

    Attributes:
        sliders: (5,), values of the sliders.
        moves: (5,), how often the person has moved each since the start.
        rates: (5,), speeds that the sticks of a gamepad ask for, m/s and rad/s.
        start: (5,), coordinates at which a demonstration starts.
        starts: how often it was started.
    """

    sliders: Array
    moves: Array
    rates: Array
    start: Array
    starts: float

    SIZE = 21
    """Length of `as_vector`."""

    def as_vector(self) -> Array:
        """Returns (SIZE,); `from_vector` inverts it."""
        return np.concatenate([self.sliders, self.moves, self.rates, self.start, np.array([self.starts])])

    @classmethod
    def from_vector(cls, v: Array) -> HandInput:
        """Returns the input of a vector that `as_vector` has returned."""
        return cls(v[0:5], v[5:10], v[10:15], v[15:20], float(v[20]))


class PageInput:
    """Sends what the person wants of the hand, at once after each event of the page, to a `PageHand`.

    Args:
        controls: of the page; the sliders are added.
        write: takes a vector of `HandInput`; it is called by one thread at a time.
    """

    def __init__(self, controls: HandControls, write: Callable[[Array], None]) -> None:
        self._controls, self._write = controls, write
        self._lock = threading.Lock()
        self._start, self._starts = np.zeros(len(SLIDERS)), 0
        self._moves_before = np.zeros(len(SLIDERS))
        for label, low, high, step, less, more in SLIDERS:
            controls.AddSlider(label, low, high, step, 0.0, less, more)
        controls.call_after_motion(self._send)

    def start(self, X_HD: RigidTransform) -> None:
        """Moves the hand, and the sliders, to the pose at which a demonstration starts."""
        with self._lock:
            self._start, self._starts = hand_coordinates(X_HD), self._starts + 1
            self._moves_before = self._moves()
            self._show(self._start, range(len(SLIDERS)))
        self._send()

    def follow(self, X_HD: RigidTransform) -> None:
        """Moves the sliders that the sticks of a gamepad control to the pose of the hand."""
        self._show(hand_coordinates(X_HD), np.flatnonzero(stick_rates(self._controls.GetGamepad())).tolist())

    def _show(self, coordinates: Array, sliders: Iterable[int]) -> None:
        for k in sliders:
            self._controls.SetSliderValue(SLIDERS[k][0], float(coordinates[k] / UNITS[k]))

    def _moves(self) -> Array:
        return np.array([self._controls.slider_moves(slider[0]) for slider in SLIDERS], dtype=float)

    def _send(self) -> None:
        with self._lock:
            wanted = HandInput(
                sliders=UNITS * [self._controls.GetSliderValue(slider[0]) for slider in SLIDERS],
                moves=self._moves() - self._moves_before,
                rates=stick_rates(self._controls.GetGamepad()),
                start=self._start,
                starts=self._starts,
            )
            self._write(wanted.as_vector())


class PageHand:
    """The hand of a person at the page; implements `LiveDevice`, without force feedback.

    Its depth along the axis, tilt and offset approach a target at a limited rate: the slider that the person has moved
    last, or where the sticks of a gamepad have moved the target since. A slider rounds its value, the target is not
    rounded. Tilt and offset are to the right and away from the person (frame V).

    Args:
        read: returns the newest vector of `HandInput`, or None if there is none since the last call.
        clock: time in s; tests give their own.
    """

    def __init__(self, read: Callable[[], Array | None], clock: Callable[[], float] = time.monotonic) -> None:
        self._read, self._clock, self._last = read, clock, clock()
        nothing = np.zeros(len(SLIDERS))
        self._input = HandInput(nothing, nothing, nothing, nothing, starts=0.0)
        self._target = self._coordinates = nothing

    def read_pose(self) -> RigidTransform:
        """Returns the pose X_HD of the hand; moves it up to now."""
        now = self._clock()
        step = min(now - self._last, MAX_STEP)
        self._last = now
        values = self._read()
        if values is not None:
            self._take(HandInput.from_vector(values))
        rates = self._input.rates
        self._target = np.where(rates == 0.0, self._target, np.clip(self._target + step * rates, LOW, HIGH))
        wanted = (self._target - self._coordinates) * (step / SETTLING_TIME)
        self._coordinates = self._coordinates + np.clip(wanted, -step * MAX_RATES, step * MAX_RATES)
        return hand_pose(self._coordinates)

    def write_wrench(self, wrench: Array) -> None:
        """Does nothing: the page shows the force."""

    def close(self) -> None:
        """Does nothing."""

    def _take(self, new: HandInput) -> None:
        """Takes what the person wants now."""
        moves = self._input.moves
        if new.starts != self._input.starts:
            self._target = self._coordinates = new.start
            moves = np.zeros(len(SLIDERS))
        self._target = np.where(new.moves != moves, new.sliders, self._target)
        self._input = new


def stick_rates(pad: Sticks) -> Array:
    """Returns the speeds (5,) that the sticks of a gamepad ask for, m/s and rad/s."""
    rates = np.zeros(len(SLIDERS))
    if pad.index is None or len(pad.axes) <= max(axis for _, axis, _ in STICKS):
        return rates
    for slider, axis, sign in STICKS:
        if abs(pad.axes[axis]) > IDLE:
            rates[slider] = sign * pad.axes[axis] * MAX_RATES[slider]
    return rates
