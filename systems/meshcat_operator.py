"""A person who moves the probe from the browser: sliders, keys and a gamepad."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from pydrake.common.value import Value
from pydrake.geometry import Meshcat
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

from systems.rotation import from_rotation_vector
from systems.simulated_operator import seen_misalignment

# Label, lower and upper end, step, keys for less and more; millimetres and degrees, as a person reads them.
SLIDERS = (
    ("depth mm S/W", -10.0, 40.0, 0.5, "KeyS", "KeyW"),
    ("tilt x ° ↑/↓", -5.0, 5.0, 0.1, "ArrowUp", "ArrowDown"),
    ("tilt y ° ←/→", -5.0, 5.0, 0.1, "ArrowLeft", "ArrowRight"),
    ("x mm J/L", -5.0, 5.0, 0.05, "KeyJ", "KeyL"),
    ("y mm M/I", -5.0, 5.0, 0.05, "KeyM", "KeyI"),
)
UNITS = np.array([1e-3, math.radians(1.0), math.radians(1.0), 1e-3, 1e-3])
FASTEST = np.array([0.025, math.radians(8.0), math.radians(8.0), 0.010, 0.010])  # a hand's, in m/s and rad/s
IDLE = 0.12  # of a stick's deflection, that counts as none
FEED_STICK, TILT_X_STICK, TILT_Y_STICK = 3, 1, 0  # axes of a gamepad: right stick, left stick


class MeshcatOperator(LeafSystem):
    """
    .. pydrake_system::

        name: MeshcatOperator
        output_ports:
        - hand_pose

    The hand's depth along its axis, tilt about x and y, and offset follow sliders in the browser, no faster than a
    hand moves; the sticks of a gamepad move the sliders. The pose is that of the probe in H. What the browser says is
    read at every period and kept in the Context, so that between two readings the pose is a function of the Context
    alone.
    """

    def __init__(self, *, meshcat: Meshcat, period: float, X_HD_start: RigidTransform) -> None:
        super().__init__()
        self._meshcat = meshcat
        self._period = period
        begin = hand_coordinates(X_HD_start)
        add_sliders(meshcat, begin)
        # [coordinates at the last reading, their rates since, time of the reading]
        self._hand = self.DeclareDiscreteState(np.concatenate([begin, np.zeros(6)]))
        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, self._read)
        self.DeclareAbstractOutputPort(
            "hand_pose", Value[RigidTransform], self._calc, {self.discrete_state_ticket(self._hand), self.time_ticket()}
        )

    def _read(self, context: Context, discrete_state: DiscreteValues) -> None:
        now = context.get_time()
        hand = context.get_discrete_state(self._hand).value()
        coordinates = hand[:5] + hand[5:10] * (now - hand[10])
        self._follow_gamepad()
        wanted = UNITS * [self._meshcat.GetSliderValue(slider[0]) for slider in SLIDERS]
        rates = np.clip((wanted - coordinates) / self._period, -FASTEST, FASTEST)
        discrete_state.get_mutable_vector(self._hand).SetFromVector(np.concatenate([coordinates, rates, [now]]))

    def _follow_gamepad(self) -> None:
        pad = self._meshcat.GetGamepad()
        if pad.index is None or len(pad.axes) <= FEED_STICK:
            return
        for slider, axis in ((0, FEED_STICK), (1, TILT_X_STICK), (2, TILT_Y_STICK)):
            deflection = float(pad.axes[axis])
            if abs(deflection) > IDLE:
                label = SLIDERS[slider][0]
                step = deflection * FASTEST[slider] * self._period / UNITS[slider]
                self._meshcat.SetSliderValue(label, self._meshcat.GetSliderValue(label) + step)

    def _calc(self, context: Context, output: Value) -> None:
        hand = context.get_discrete_state(self._hand).value()
        output.set_value(hand_pose(hand[:5] + hand[5:10] * (context.get_time() - hand[10])))


def hand_pose(coordinates: NDArray[np.float64]) -> RigidTransform:
    """X_HD of [depth along the axis, tilt about x, about y, offset along x, along y] (m, rad)."""
    depth, tilt_x, tilt_y, x, y = coordinates
    R_HD = from_rotation_vector(np.array([tilt_x, tilt_y, 0.0]))
    return RigidTransform(R_HD, np.array([x, y, 0.0]) - depth * R_HD.col(2))


def hand_coordinates(X_HD: RigidTransform) -> NDArray[np.float64]:
    """The inverse of `hand_pose`."""
    tilt, offset = seen_misalignment(X_HD)
    reach = X_HD.translation() - np.array([*offset, 0.0])
    return np.array([-(reach @ X_HD.rotation().col(2)), *tilt, *offset])


def add_sliders(meshcat: Meshcat, coordinates: NDArray[np.float64]) -> None:
    """Puts the sliders into the browser, or back to where the hand is."""
    known = meshcat.GetSliderNames()
    for (label, low, high, step, less, more), value in zip(SLIDERS, coordinates / UNITS, strict=True):
        if label not in known:
            meshcat.AddSlider(label, low, high, step, 0.0, less, more)
        meshcat.SetSliderValue(label, float(value))
