"""Reads a person's hand motion from the browser: sliders, keys and a gamepad."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from systems.math.rotation import from_rotation_vector
from systems.operators.simulated_operator import seen_misalignment

# Label, minimum, maximum, step, keys to decrease and increase; in millimetres and degrees for display.
SLIDERS = (
    ("depth mm (S W)", -10.0, 40.0, 0.5, "KeyS", "KeyW"),
    ("tilt right ° (← →)", -5.0, 5.0, 0.1, "ArrowLeft", "ArrowRight"),
    ("tilt away ° (↓ ↑)", -5.0, 5.0, 0.1, "ArrowDown", "ArrowUp"),
    ("right mm (J L)", -5.0, 5.0, 0.05, "KeyJ", "KeyL"),
    ("away mm (K I)", -5.0, 5.0, 0.05, "KeyK", "KeyI"),
)
UNITS = np.array([1e-3, math.radians(1.0), math.radians(1.0), 1e-3, 1e-3])
MAX_RATES = np.array([0.025, math.radians(8.0), math.radians(8.0), 0.010, 0.010])  # of the hand, in m/s and rad/s
IDLE = 0.12  # share of a stick's full deflection below which a deflection is ignored
# Slider, axis of a standard gamepad (right stick down, left stick right, left stick down), and sign.
STICKS = ((0, 3, 1.0), (1, 0, 1.0), (2, 1, -1.0))
# Frame V of the person in front of the cutaway: x to the right, y away, z up.
R_HV = RotationMatrix.MakeZRotation(math.radians(135.0))


@dataclass(frozen=True)
class SliderState:
    """State of the operator; `as_list` and `from_vector` convert it to and from a discrete state (21,).

    Arrays have one element for each slider, in m and rad.

    Attributes:
        coordinates: Coordinates of the hand at the last reading (5,); see `hand_pose`.
        rates: Rates of the coordinates since then (5,), m/s and rad/s.
        time: Time of the last reading, s.
        target: Target coordinates (5,). Unlike the sliders they are not rounded to the sliders' steps.
        sliders: Values of the sliders after the last reading (5,).
    """

    coordinates: NDArray[np.float64]
    rates: NDArray[np.float64]
    time: float
    target: NDArray[np.float64]
    sliders: NDArray[np.float64]

    @classmethod
    def from_vector(cls, v: NDArray[np.float64]) -> SliderState:
        """The inverse of `as_list`."""
        return cls(coordinates=v[0:5], rates=v[5:10], time=v[10], target=v[11:16], sliders=v[16:21])

    def as_list(self) -> list[float]:
        """[*coordinates, *rates, time, *target, *sliders]."""
        return [*self.coordinates, *self.rates, self.time, *self.target, *self.sliders]

    def coordinates_at(self, time: float) -> NDArray[np.float64]:
        """Returns the coordinates (5,) of the hand at ``time`` (s), at or after the last reading."""
        return self.coordinates + self.rates * (time - self.time)


class MeshcatOperator(LeafSystem):
    """
    .. pydrake_system::

        name: MeshcatOperator
        output_ports:
        - hand_pose

    The depth of the hand along its axis, its tilt and its offset follow sliders in the browser, at a limited rate. Tilt
    and offset are to the right and away from the person in front of the cutaway (frame V). The sticks of a gamepad move
    the sliders. ``hand_pose`` is the pose X_HD of the probe. The sliders are read once per period and their values are
    kept in the Context, so that between two readings the pose depends on the Context only.

    Args:
        meshcat: Meshcat instance with the sliders, or `LiveControls`, which has the same methods.
        period: Reading period, s.
        X_HD_start: Pose of the probe at the start.
    """

    def __init__(self, *, meshcat: Meshcat, period: float, X_HD_start: RigidTransform) -> None:
        super().__init__()
        self._meshcat = meshcat
        self._period = period
        begin = hand_coordinates(X_HD_start)
        add_sliders(meshcat, begin)
        start = SliderState(
            coordinates=begin, rates=np.zeros(len(begin)), time=0.0, target=begin, sliders=self._sliders()
        )
        self._hand = self.DeclareDiscreteState(start.as_list())
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._read)
        self.DeclareAbstractOutputPort(
            "hand_pose", Value[RigidTransform], self._calc, {self.discrete_state_ticket(self._hand), self.time_ticket()}
        )

    def _read(self, context: Context, discrete_state: DiscreteValues) -> None:
        now = context.get_time()
        hand = SliderState.from_vector(context.get_discrete_state(self._hand).value())
        coordinates = hand.coordinates_at(now)
        # A slider value is rounded to its step, a stick's target is not: keep the target until a slider is moved.
        sliders = self._sliders()
        target = np.where(sliders != hand.sliders, sliders, hand.target)
        for slider, speed in self._sticks():
            label, low, high = SLIDERS[slider][:3]
            unit = UNITS[slider]
            target[slider] = np.clip(target[slider] + speed * self._period, low * unit, high * unit)
            self._meshcat.SetSliderValue(label, target[slider] / unit)
        rates = np.clip((target - coordinates) / self._period, -MAX_RATES, MAX_RATES)
        new = SliderState(coordinates=coordinates, rates=rates, time=now, target=target, sliders=self._sliders())
        discrete_state.get_mutable_vector(self._hand).SetFromVector(new.as_list())

    def _sliders(self) -> NDArray[np.float64]:
        """Returns the values of the sliders (5,), m and rad."""
        return np.asarray(UNITS * [self._meshcat.GetSliderValue(slider[0]) for slider in SLIDERS])

    def _sticks(self) -> Iterator[tuple[int, float]]:
        """Yields the slider index and its rate (m/s or rad/s) for every deflected stick of a gamepad."""
        pad = self._meshcat.GetGamepad()
        if pad.index is None or len(pad.axes) <= max(axis for _, axis, _ in STICKS):
            return
        for slider, axis, sign in STICKS:
            deflection = float(pad.axes[axis])
            if abs(deflection) > IDLE:
                yield slider, sign * deflection * float(MAX_RATES[slider])

    def _calc(self, context: Context, output: Value) -> None:
        hand = SliderState.from_vector(context.get_discrete_state(self._hand).value())
        output.set_value(hand_pose(hand.coordinates_at(context.get_time())))


def hand_pose(coordinates: NDArray[np.float64]) -> RigidTransform:
    """Returns X_HD of a hand.

    Args:
        coordinates: Depth along the axis, tilt to the right, tilt away, offset to the right, offset away (5,), in m
            and rad.
    """
    depth, right, away, *offset = coordinates
    R_HD = from_rotation_vector(R_HV @ np.array([-away, right, 0.0]))
    return RigidTransform(R_HD, R_HV @ np.array([*offset, 0.0]) - depth * R_HD.col(2))


def hand_coordinates(X_HD: RigidTransform) -> NDArray[np.float64]:
    """Returns the coordinates (5,) of a pose X_HD without spin; the inverse of `hand_pose`."""
    tilt, offset = (R_HV.inverse() @ np.array([*xy, 0.0]) for xy in seen_misalignment(X_HD))
    reach = X_HD.translation() - R_HV @ offset
    return np.array([-(reach @ X_HD.rotation().col(2)), tilt[1], -tilt[0], *offset[:2]])


def add_sliders(meshcat: Meshcat, coordinates: NDArray[np.float64]) -> None:
    """Adds the sliders to the browser if they are missing, and sets them to ``coordinates`` (5,), m and rad."""
    known = meshcat.GetSliderNames()
    for (label, low, high, step, less, more), value in zip(SLIDERS, coordinates / UNITS, strict=True):
        if label not in known:
            meshcat.AddSlider(label, low, high, step, 0.0, less, more)
        meshcat.SetSliderValue(label, float(value))
