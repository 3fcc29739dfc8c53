"""What a person at the controls is shown: the force as an arrow and a bar, figures, instructions, views."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydrake.geometry import Cylinder, Meshcat, MeshcatCone, Rgba
from pydrake.math import RigidTransform, RotationMatrix

from systems.live.page import LivePage
from systems.math.rotation import from_rotation_vector, rotation_between
from systems.operators.meshcat_operator import R_HV
from systems.visualization.scene import aim_camera

FELT_SCALE, CONTACT_SCALE = 250.0, 1500.0  # in units of N/m, of the arrows; live_panel.html says so
HEAD_LENGTH = 0.004  # in units of m
CALM, WARM, SATURATED = Rgba(0.10, 0.55, 0.20), Rgba(0.93, 0.62, 0.05), Rgba(0.85, 0.05, 0.08)
CONTACT = Rgba(0.16, 0.38, 0.88)
WARM_SHARE = 0.5  # of what the device can give
# Key, and where the camera is in V, the person's frame (x right, y away), in units of m.
VIEWS = {
    "view of the cut (1)": ("Digit1", [0.0, -0.075, 0.040]),
    "view from above (2)": ("Digit2", [0.0, -0.001, 0.120]),
    "view from the side (3)": ("Digit3", [0.058, -0.058, 0.010]),
}
LOOK_AT = [0.0, 0.0, 0.004]  # in units of m


class Arrow:
    """An arrow that can be moved, seen through the peg in which it may begin.

    Args:
        meshcat: to draw into.
        name: its own, below ``live/``.
        scale: N a metre.
        order: in which arrows are drawn, the highest on top.
    """

    def __init__(self, meshcat: Meshcat, name: str, *, scale: float, order: float) -> None:
        self._meshcat, self._scale = meshcat, scale
        self._shaft, self._head = f"live/{name}/shaft", f"live/{name}/head"
        self._colour: Rgba | None = None
        meshcat.SetObject(self._shaft, Cylinder(0.0008, 1.0))
        meshcat.SetObject(self._head, MeshcatCone(HEAD_LENGTH, 0.002, 0.002))
        for path in (self._shaft, self._head):
            meshcat.SetProperty(f"{path}/<object>", "material.depthTest", False)
            meshcat.SetProperty(f"{path}/<object>", "renderOrder", order)

    def draw(self, start: NDArray[np.float64], force: NDArray[np.float64], colour: Rgba) -> None:
        """Puts it at ``start`` (m), along ``force`` (N), both in W."""
        size = float(np.linalg.norm(force))
        along = force / size if size > 1e-9 else np.array([0.0, 0.0, 1.0])
        R = from_rotation_vector(rotation_between(np.array([0.0, 0.0, 1.0]), along))
        length = size / self._scale
        shaft = max(1e-6, length - HEAD_LENGTH)
        matrix = RigidTransform(R, start + 0.5 * shaft * along).GetAsMatrix4()
        matrix[:3, :2] *= min(1.0, max(1e-6, length / HEAD_LENGTH))  # no disc is left of no force
        matrix[:3, 2] *= shaft
        self._meshcat.SetTransform(self._shaft, matrix)
        head = min(1.0, length / HEAD_LENGTH)
        turned = R @ RotationMatrix.MakeXRotation(math.pi)  # a cone of Meshcat's has its point at the origin, below
        matrix = RigidTransform(turned, start + (shaft + head * HEAD_LENGTH) * along).GetAsMatrix4()
        matrix[:3, :3] *= max(1e-6, head)
        self._meshcat.SetTransform(self._head, matrix)
        if colour != self._colour:  # every change of a material costs the browser a frame
            self._colour = colour
            # The viewer takes linear light; and what is all but opaque it draws last, over the peg.
            linear = [value**2.2 for value in (colour.r(), colour.g(), colour.b())]
            for path in (self._shaft, self._head):
                self._meshcat.SetProperty(path, "color", [*linear, 0.99])


class LiveDisplay:
    """Draws into a Meshcat and its page; it holds no state that a simulation depends on.

    Args:
        meshcat: for the arrow, and the buttons of the views.
        page: whose panel shows the bar, the figures and the words.
        keys: what the panel says of the controls, (keys, what they do) a line.
    """

    def __init__(self, meshcat: Meshcat, page: LivePage, *, keys: list[tuple[list[str], str]]) -> None:
        self._meshcat, self._page = meshcat, page
        self._felt = Arrow(meshcat, "felt_force", scale=FELT_SCALE, order=11.0)
        self._contact = Arrow(meshcat, "contact_force", scale=CONTACT_SCALE, order=10.0)
        for label, (key, _) in VIEWS.items():
            meshcat.AddButton(label, key)
        self._views = dict.fromkeys(VIEWS, 0)
        self._view = next(iter(VIEWS))
        page.show(keys=keys)
        self.look()

    def say(self, status: str) -> None:
        """Shows a line over the scene."""
        self._page.show(status=status)

    def show_forces(
        self,
        X_HP: RigidTransform,
        wrench: NDArray[np.float64],
        *,
        share: float,
        touch: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
    ) -> None:
        """Draws the rendered force, the last three of ``wrench``, at the tip, and the contact's where it acts.

        Args:
            X_HP: of the peg.
            wrench: rendered, [torque; force] in H.
            share: of what the device can give that was asked for; it makes the colour.
            touch: point and force of the contact (see `VirtualEnvironment.touch`).
        """
        tip = X_HP.translation()
        self._felt.draw(tip, wrench[3:], colour_of(share))
        point, force = touch if touch is not None else (tip, np.zeros(3))
        self._contact.draw(point, force, CONTACT)

    def show_figures(self, X_HP: RigidTransform, wrench: NDArray[np.float64], *, share: float, **figures: Any) -> None:
        """Shows in the panel where the peg is, the rendered wrench [torque; force], and ``figures`` by their names.

        The names and units are those of live_panel.html: ``depth`` (m, of m), ``rate``, ``missed`` (see
        `live_session.Clock.missed`), ``energy``, ``lowest`` (J), ``kept``.
        """
        colour = colour_of(share)
        lean = np.degrees(R_HV.inverse() @ X_HP.rotation().col(2))
        self._page.show(
            force=float(np.linalg.norm(wrench[3:])),
            moment=float(np.linalg.norm(wrench[:3])),
            share=share,
            colour=f"rgb({255 * colour.r():.0f}, {255 * colour.g():.0f}, {255 * colour.b():.0f})",
            lean=[float(lean[0]), float(lean[1])],
            **figures,
        )

    def look(self) -> None:
        """Puts the camera back to the view that was asked for last."""
        aim_camera(self._meshcat, camera=R_HV @ np.array(VIEWS[self._view][1]), target=np.array(LOOK_AT))

    def follow_views(self) -> None:
        """Moves the camera where a view has been asked for."""
        for label in VIEWS:
            clicks = self._meshcat.GetButtonClicks(label)
            if clicks != self._views[label]:
                self._views[label], self._view = clicks, label
                self.look()


def colour_of(share: float) -> Rgba:
    """Of a force that asks for ``share`` of what the device can give."""
    return SATURATED if share >= 1.0 else WARM if share > WARM_SHARE else CALM
