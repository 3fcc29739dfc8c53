"""What a live session shows: arrows of the forces, readings, messages and camera views."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.geometry import Rgba, Role
from pydrake.math import RigidTransform
from pydrake.systems.framework import DiagramBuilder

from interfaces.live.arrow import Arrow
from interfaces.live.page import LivePage
from interfaces.live.viewer_scene import ViewerScene
from models.scenario import Scenario
from skill.arrays import Array
from skill.features.measurement import MEASURED, contact_load
from skill.policy.policy_observer import Judgement
from skill.states.state_style import state_colours
from systems.math.rotation import from_rotation_vector
from systems.operators.person_frame import R_HV
from systems.plant.contact_plant import AddVirtualPlant, ContactPlant, peg_shape
from systems.servo.probe import Probe
from systems.virtual_environment import start_pose

RENDERED_SCALE, CONTACT_SCALE = 250.0, 1500.0  # in units of N/m of arrow; panel.html states them too
# An arrow is a little transparent, so that the viewer draws it last: see `Arrow`.
LOW, HIGH, SATURATED = Rgba(0.10, 0.55, 0.20, 0.99), Rgba(0.93, 0.62, 0.05, 0.99), Rgba(0.85, 0.05, 0.08, 0.99)
CONTACT = Rgba(0.16, 0.38, 0.88, 0.99)
HAND = Rgba(0.12, 0.14, 0.16, 0.22)
FEED = Rgba(0.55, 0.16, 0.62, 0.99)
FEED_SCALE = 1.0  # in units of m/s per m of arrow
FEED_HEIGHT = 0.022  # in units of m, of the start of the arrow over the tip
LOOK_AHEAD = 0.5  # in units of s, over which the dial shows the skill's turn
GHOST = 0.98  # of the peg's size: surfaces at the same place would flicker
HIGH_LOAD = 0.5  # load of the device above which the rendered force has the colour HIGH
# Key and camera position of each view, in m in the frame V of the person (x right, y away from the person).
VIEWS = {
    "view of the cut (1)": ("Digit1", [0.0, -0.075, 0.040]),
    "view from above (2)": ("Digit2", [0.0, -0.001, 0.120]),
    "view from the side (3)": ("Digit3", [0.058, -0.058, 0.010]),
}
CAMERA_TARGET = np.array([0.0, 0.0, 0.004])  # in units of m, in W


class ContactLoad:
    """The contact load as the rig's force guard counts it: of the newest sample of a run, and the largest so far.

    Args:
        scenario: of the run, with the limits of the guard.

    Attributes:
        load: sqrt(|f|^2 + |m/r|^2) of the contact wrench, N.
        peak: largest load so far, N.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._lever, self._guard = scenario.geometry.reach, scenario.controller.guard
        self.load = self.peak = 0.0

    def take(self, sample: Mapping[Any, float]) -> None:
        """Takes a sample of the recorder; ignores one that is not finite, of a run that has diverged."""
        load = contact_load(np.array([sample[name] for name in MEASURED[:6]]), self._lever)
        if math.isfinite(load):
            self.load, self.peak = load, max(self.peak, load)

    def values(self) -> dict[str, float | bool]:
        """Returns what the panel shows; ``held`` says whether the rig's guard would slow the feed."""
        return {
            "load": self.load,
            "limit": self._guard.force_limit,
            "peak": self.peak,
            "held": self.load > self._guard.soft_force,
        }


NO_HAND = Probe(0.0, RigidTransform(), np.zeros(6), np.zeros(6), load=0.0, energy=0.0, min_energy=0.0, gain=1, age=0)
"""The probe of the rig, which no hand moves."""


class LiveDisplay:
    """Shows a session on its page. It holds no state that a simulation depends on.

    Args:
        page: page with the scene, the buttons of the views, and the panel of readings and messages.
        moves_hand: whether the controls of the page move the peg, and not a haptic device.
    """

    def __init__(self, page: LivePage, *, moves_hand: bool = True) -> None:
        self._page = page
        self._contact = Arrow(page.scene, "live/contact_force", scale=CONTACT_SCALE, colour=CONTACT, order=10.0)
        self._rendered = Arrow(page.scene, "live/rendered_force", scale=RENDERED_SCALE, colour=LOW, order=11.0)
        self._feed = Arrow(page.scene, "live/skill_feed", scale=FEED_SCALE, colour=FEED, order=12.0)
        for label, (key, _) in VIEWS.items():
            page.controls.AddButton(label, key)
        self._view = next(iter(VIEWS))
        for path in ("/Grid", "/Axes"):  # they are metres wide
            page.scene.SetProperty(path, "visible", False)
        page.scene.SetProperty("/Lights/AmbientLight/<object>", "intensity", 0.9)
        page.show(motion=moves_hand)
        self.reset_camera()

    def draw_start(self, scenario: Scenario) -> None:
        """Draws peg and hole as they are at the start of a resolved scenario."""
        draw_bodies(self._page.scene, AddVirtualPlant(DiagramBuilder(), scenario))
        X_PC, ghost = peg_shape(scenario.geometry, GHOST)
        self._page.scene.SetObject("live/hand/ghost", ghost, HAND)
        self._page.scene.SetTransform("live/hand/ghost", X_PC)
        X_HP = start_pose(scenario)
        self.draw_bodies(X_HP, X_HP)
        self.draw_forces(X_HP.translation(), np.zeros(3), load=0.0, contact=None)
        self._feed.draw(X_HP.translation(), np.zeros(3))
        self._page.show(skill=None, hand=True)

    def draw_bodies(self, X_WP: RigidTransform, X_WD: RigidTransform, X_WH: RigidTransform | None = None) -> None:
        """Draws the peg, the ghost, which is the peg where the hand would have it, and the block, which the rig turns.

        In the virtual environment W is H.
        """
        poses = {"plant/peg": X_WP, "live/hand": X_WD, "plant/hole": X_WH or RigidTransform()}
        for path, X in poses.items():
            self._page.scene.SetTransform(path, X)

    def draw_forces(
        self,
        tip: Array,
        force: Array,
        *,
        load: float,
        contact: tuple[Array, Array] | None,
    ) -> None:
        """Draws the rendered force at the tip, and the contact force at the contact.

        Args:
            tip: (3,), tip of the peg in W, m.
            force: (3,), rendered force in W, N.
            load: load of the device, which gives the colour; see `Probe`.
            contact: point (m) and force (N) of the contact in W; None draws no contact force.
        """
        self._rendered.set_colour(load_colour(load))
        self._rendered.draw(tip, force)
        point, contact_force = contact if contact is not None else (tip, np.zeros(3))
        self._contact.draw(point, contact_force)

    def show_judgement(
        self,
        judgement: Judgement,
        *,
        names: Sequence[str],
        X_HP: RigidTransform,
        period: float,
        X_WH: RigidTransform | None = None,
    ) -> None:
        """Shows the state that a policy sees, and what it would do: its feed as an arrow, its turn in the dial.

        Args:
            judgement: of the policy.
            names: of its states.
            X_HP: pose of the peg.
            period: of the policy, s.
            X_WH: pose of the block; None is that of the virtual environment, in which W is H.
        """
        feed, turn = judgement.action.feed / period, judgement.action.turn / period
        axis, X_WP = X_HP.rotation().col(2), X_HP if X_WH is None else X_WH @ X_HP
        axis_W = X_WP.rotation().col(2)
        self._feed.draw(X_WP.translation() + FEED_HEIGHT * axis_W, feed * axis_W)
        turned = X_HP.rotation() @ from_rotation_vector(np.array([*(LOOK_AHEAD * turn), 0.0]))
        self._page.show(
            skill={
                "state": names[judgement.state],
                "colour": state_colours(len(names))[judgement.state],
                "known": judgement.known,
                "feed": feed,
                "turn": float(np.linalg.norm(turn)),
                "tilt": _seen_tilt(axis),
                "turned": _seen_tilt(turned.col(2)),
            }
        )

    def show_readings(
        self,
        X_HP: RigidTransform,
        *,
        depth: float,
        full_depth: float,
        rate: float,
        kept: int,
        probe: Probe = NO_HAND,
        late_steps: int = 0,
        steps: int = 0,
    ) -> None:
        """Shows readings in the panel; see `LivePage.show`.

        Args:
            X_HP: pose of the peg.
            depth: depth of the tip, m.
            full_depth: depth of an inserted peg, m.
            rate: simulated time per wall-clock time.
            kept: number of demonstrations kept in this session.
            probe: what the device renders, the energy that the hand has put in, and the servo's ticks.
            late_steps: contact steps that began after the end of their time.
            steps: contact steps.
        """
        colour = load_colour(probe.load)
        self._page.show(
            force=float(np.linalg.norm(probe.wrench[3:])),
            moment=float(np.linalg.norm(probe.wrench[:3])),
            load=probe.load,
            colour=f"rgb({255 * colour.r():.0f}, {255 * colour.g():.0f}, {255 * colour.b():.0f})",
            tilt=_seen_tilt(X_HP.rotation().col(2)),
            depth={"tip": depth, "full": full_depth},
            rate=rate,
            deadlines={"late_steps": late_steps, "steps": steps, "late_ticks": probe.late, "ticks": probe.ticks},
            energy=probe.energy,
            min_energy=probe.min_energy,
            kept=kept,
        )

    def reset_camera(self) -> None:
        """Puts the camera back to the view chosen last."""
        self._page.scene.SetCameraPose(R_HV @ np.array(VIEWS[self._view][1]), CAMERA_TARGET)

    def follow_view_buttons(self) -> None:
        """Moves the camera if the button of a view has been clicked."""
        for label in VIEWS:
            if self._page.controls.clicked(label):
                self._view = label
                self.reset_camera()


def draw_bodies(scene: ViewerScene, contact: ContactPlant) -> None:
    """Draws the pictures of the bodies of a plant, each below a path that has the pose of its body."""
    plant, inspector = contact.plant, contact.scene_graph.model_inspector()
    for geometry in inspector.GetAllGeometryIds(Role.kIllustration):
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        instance = plant.GetModelInstanceName(body.model_instance())
        path = f"plant/{instance}/{body.name()}/{inspector.GetName(geometry)}"
        rgba = inspector.GetIllustrationProperties(geometry).GetProperty("phong", "diffuse")
        scene.SetObject(path, inspector.GetShape(geometry), rgba)
        scene.SetTransform(path, inspector.GetPoseInFrame(geometry))


def _seen_tilt(axis: Array) -> dict[str, float]:
    """Returns the tilt of an axis (3,) as the person sees it, degrees."""
    tilt = np.degrees(R_HV.inverse() @ axis)
    return {"right": float(tilt[0]), "away": float(tilt[1])}


def load_colour(load: float) -> Rgba:
    """Returns the colour of the rendered force for a load of the device; see `Probe`."""
    if load >= 1.0:
        return SATURATED
    return HIGH if load > HIGH_LOAD else LOW
