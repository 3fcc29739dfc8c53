"""A person who moves the probe from the browser: sliders, keys and a gamepad."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from systems.math.rotation import from_rotation_vector
from systems.operators.simulated_operator import seen_misalignment

# Label, lower and upper end, step, keys for less and more; millimetres and degrees, as a person reads them.
SLIDERS = (
    ("depth mm (S W)", -10.0, 40.0, 0.5, "KeyS", "KeyW"),
    ("lean right ° (← →)", -5.0, 5.0, 0.1, "ArrowLeft", "ArrowRight"),
    ("lean away ° (↓ ↑)", -5.0, 5.0, 0.1, "ArrowDown", "ArrowUp"),
    ("right mm (J L)", -5.0, 5.0, 0.05, "KeyJ", "KeyL"),
    ("away mm (K I)", -5.0, 5.0, 0.05, "KeyK", "KeyI"),
)
UNITS = np.array([1e-3, math.radians(1.0), math.radians(1.0), 1e-3, 1e-3])
FASTEST = np.array([0.025, math.radians(8.0), math.radians(8.0), 0.010, 0.010])  # a hand's, in m/s and rad/s
IDLE = 0.12  # of a stick's deflection, that counts as none
# Slider, axis of a standard gamepad (right stick down, left stick right, left stick down), and its sign.
STICKS = ((0, 3, 1.0), (1, 0, 1.0), (2, 1, -1.0))
# The person stands where the block is cut open: x to their right, y away from them, z up.
R_HV = RotationMatrix.MakeZRotation(math.radians(135.0))


class MeshcatOperator(LeafSystem):
    """
    .. pydrake_system::

        name: MeshcatOperator
        output_ports:
        - hand_pose

    The hand's depth along its axis, its lean and its offset, to the right and away as the person V before the cut
    sees them, follow sliders in the browser, no faster than a hand moves; the sticks of a gamepad move the sliders. The
    pose is that of the probe in H. What the browser says is read at every period and kept in the Context, so that
    between two readings the pose is a function of the Context alone.
    """

    def __init__(self, *, meshcat: Meshcat, period: float, X_HD_start: RigidTransform) -> None:
        super().__init__()
        self._meshcat = meshcat
        self._period = period
        begin = hand_coordinates(X_HD_start)
        add_sliders(meshcat, begin)
        # [coordinates at the last reading, their rates since, time of the reading; where they are wanted, the sliders]
        self._hand = self.DeclareDiscreteState(np.concatenate([begin, np.zeros(6), begin, self._sliders()]))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._read)
        self.DeclareAbstractOutputPort(
            "hand_pose", Value[RigidTransform], self._calc, {self.discrete_state_ticket(self._hand), self.time_ticket()}
        )

    def _read(self, context: Context, discrete_state: DiscreteValues) -> None:
        now = context.get_time()
        hand = context.get_discrete_state(self._hand).value()
        coordinates = hand[:5] + hand[5:10] * (now - hand[10])
        # A slider has steps, a stick has none: where the hand is wanted is kept apart, until a slider is moved.
        sliders = self._sliders()
        wanted = np.where(sliders != hand[16:21], sliders, hand[11:16])
        for slider, speed in self._sticks():
            label, low, high = SLIDERS[slider][:3]
            unit = UNITS[slider]
            wanted[slider] = np.clip(wanted[slider] + speed * self._period, low * unit, high * unit)
            self._meshcat.SetSliderValue(label, wanted[slider] / unit)
        rates = np.clip((wanted - coordinates) / self._period, -FASTEST, FASTEST)
        discrete_state.get_mutable_vector(self._hand).SetFromVector(
            np.concatenate([coordinates, rates, [now], wanted, self._sliders()])
        )

    def _sliders(self) -> NDArray[np.float64]:
        return np.asarray(UNITS * [self._meshcat.GetSliderValue(slider[0]) for slider in SLIDERS])

    def _sticks(self) -> Iterator[tuple[int, float]]:
        """(slider, speed in its SI unit) of every stick of a gamepad that is pushed."""
        pad = self._meshcat.GetGamepad()
        if pad.index is None or len(pad.axes) <= max(axis for _, axis, _ in STICKS):
            return
        for slider, axis, sign in STICKS:
            deflection = float(pad.axes[axis])
            if abs(deflection) > IDLE:
                yield slider, sign * deflection * float(FASTEST[slider])

    def _calc(self, context: Context, output: Value) -> None:
        hand = context.get_discrete_state(self._hand).value()
        output.set_value(hand_pose(hand[:5] + hand[5:10] * (context.get_time() - hand[10])))


def hand_pose(coordinates: NDArray[np.float64]) -> RigidTransform:
    """X_HD of [depth along the axis, lean to the right, lean away, offset to the right, offset away] (m, rad)."""
    depth, right, away, *offset = coordinates
    R_HD = from_rotation_vector(R_HV @ np.array([-away, right, 0.0]))
    return RigidTransform(R_HD, R_HV @ np.array([*offset, 0.0]) - depth * R_HD.col(2))


def hand_coordinates(X_HD: RigidTransform) -> NDArray[np.float64]:
    """The inverse of `hand_pose`."""
    tilt, offset = (R_HV.inverse() @ np.array([*xy, 0.0]) for xy in seen_misalignment(X_HD))
    reach = X_HD.translation() - R_HV @ offset
    return np.array([-(reach @ X_HD.rotation().col(2)), tilt[1], -tilt[0], *offset[:2]])


def add_sliders(meshcat: Meshcat, coordinates: NDArray[np.float64]) -> None:
    """Puts the sliders into the browser, or back to where the hand is."""
    known = meshcat.GetSliderNames()
    for (label, low, high, step, less, more), value in zip(SLIDERS, coordinates / UNITS, strict=True):
        if label not in known:
            meshcat.AddSlider(label, low, high, step, 0.0, less, more)
        meshcat.SetSliderValue(label, float(value))
