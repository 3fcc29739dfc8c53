"""What a person at the controls sees beside the scene: force arrow and bar, figures, views."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Box, Cylinder, Meshcat, Rgba
from pydrake.math import RigidTransform

from systems.rotation import from_rotation_vector, rotation_between
from systems.visualization import aim_camera

ARROW, BAR, TIP = "live/force_arrow", "live/force_bar", "live/force_head"
BAR_FULL = 0.020  # in units of m, height of the bar at the device's limit
ARROW_FULL = 0.020  # in units of m
BAR_PLACE = np.array([-0.020, 0.034, 0.0])  # in units of m, in W: beside the block
CALM, WARM, SATURATED = Rgba(0.15, 0.65, 0.25), Rgba(0.95, 0.65, 0.10), Rgba(0.90, 0.10, 0.10)
WARM_SHARE = 0.5  # of the limit
# Label, and the ends of its bar.
FIGURES = {"force N": (0, 22), "real time %": (0, 200), "missed": (0, 9999), "energy mJ": (-100, 900)}
VIEWS = {
    "view: section (1)": ("Digit1", [0.062, 0.055, 0.030]),
    "view: above (2)": ("Digit2", [0.001, 0.0, 0.095]),
    "view: side (3)": ("Digit3", [0.0, 0.085, 0.004]),
}


class LiveDisplay:
    """Draws into a Meshcat; it holds no state that a simulation depends on."""

    def __init__(self, meshcat: Meshcat) -> None:
        self._meshcat = meshcat
        self._status = ""
        meshcat.SetObject(ARROW, Cylinder(0.0008, 1.0), CALM)
        meshcat.SetObject(TIP, Cylinder(0.0016, 0.002), CALM)
        meshcat.SetObject(BAR, Box(0.004, 0.004, 1.0), CALM)
        for label, (low, high) in FIGURES.items():
            meshcat.AddSlider(label, low, high, 0.01, 0.0)
        for label, (key, _) in VIEWS.items():
            meshcat.AddButton(label, key)
        self._views = dict.fromkeys(VIEWS, 0)
        aim_camera(meshcat)
        self.show_force(np.zeros(3), np.zeros(3), share=0.0)

    def say(self, status: str) -> None:
        """Shows a line among the controls."""
        if status == self._status:
            return
        if self._status:
            self._meshcat.DeleteButton(self._status, False)
        self._status = status
        self._meshcat.AddButton(status)

    def show_force(self, p_WTip: NDArray[np.float64], force: NDArray[np.float64], *, share: float) -> None:
        """Draws the rendered force at the tip; ``share`` is its size over what the device can give now."""
        colour = SATURATED if share >= 1.0 else WARM if share > WARM_SHARE else CALM
        size = float(np.linalg.norm(force))
        along = force / size if size > 1e-9 else np.array([0.0, 0.0, 1.0])
        R = from_rotation_vector(rotation_between(np.array([0.0, 0.0, 1.0]), along))
        length = max(1e-6, ARROW_FULL * min(share, 1.0))
        self._stretch(ARROW, RigidTransform(R, p_WTip + 0.5 * length * along), length)
        self._meshcat.SetTransform(TIP, RigidTransform(R, p_WTip + length * along))
        height = max(1e-6, BAR_FULL * min(share, 1.0))
        self._stretch(BAR, RigidTransform(BAR_PLACE + np.array([0.0, 0.0, 0.5 * height])), height)
        for path in (ARROW, TIP, BAR):
            self._meshcat.SetProperty(path, "color", [colour.r(), colour.g(), colour.b(), 1.0])

    def show_figures(self, *, force: float, rate: float, missed: int, energy: float) -> None:
        """Newtons, simulated over wall time, deadlines missed so far, joules."""
        for label, value in zip(FIGURES, (force, 100.0 * rate, float(missed), 1e3 * energy), strict=True):
            self._meshcat.SetSliderValue(label, round(value, 2))
        self._meshcat.SetRealtimeRate(rate)

    def follow_views(self) -> None:
        """Moves the camera where a view has been asked for."""
        for label, (_, camera) in VIEWS.items():
            clicks = self._meshcat.GetButtonClicks(label)
            if clicks != self._views[label]:
                self._views[label] = clicks
                self._meshcat.SetCameraPose(camera_in_world=camera, target_in_world=[0.0, 0.0, -0.004])

    def _stretch(self, path: str, X: RigidTransform, length: float) -> None:
        matrix = X.GetAsMatrix4()
        matrix[:3, 2] *= length
        self._meshcat.SetTransform(path, matrix)
