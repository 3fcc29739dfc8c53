"""Shows peg, block and the contact force on the peg in Meshcat, whatever engine moves them."""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import Meshcat, Rgba, Role
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context, DiagramBuilder, EventStatus, LeafSystem

from models.scenario import Scenario
from skill.arrays import Array
from systems.math.rotation import free_body_pose
from systems.plant.contact_plant import AddRigPlant, AddVirtualPlant, ContactPlant
from systems.plant.peg_plant import PegPlant
from systems.plant.rig_plant import RigPlant
from systems.visualization.arrow import Arrow, Scene

FORCE_COLOUR = "#C1121F"
NEWTONS_PER_CENTIMETRE = 10.0
PLANT = "plant"
"""Path of the bodies; below it are the names of model instance and body."""


def draw_bodies(scene: Scene, contact: ContactPlant) -> dict[str, RigidBody]:
    """Draws the pictures of the bodies of a plant, each below a path that has the pose of its body.

    Returns:
        The bodies by their paths.
    """
    plant, inspector = contact.plant, contact.scene_graph.model_inspector()
    bodies: dict[str, RigidBody] = {}
    for geometry in inspector.GetAllGeometryIds(Role.kIllustration):
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        path = f"{PLANT}/{plant.GetModelInstanceName(body.model_instance())}/{body.name()}"
        bodies[path] = body
        rgba = inspector.GetIllustrationProperties(geometry).GetProperty("phong", "diffuse")
        scene.SetObject(f"{path}/{inspector.GetName(geometry)}", inspector.GetShape(geometry), rgba)
        scene.SetTransform(f"{path}/{inspector.GetName(geometry)}", inspector.GetPoseInFrame(geometry))
    return bodies


class PlantPicture:
    """Bodies and the contact force at the peg's tip, in Meshcat.

    Args:
        contact: has the pictures and the kinematics; it is not simulated.
        meshcat: Meshcat to draw into.

    Attributes:
        pose: context of the plant; its positions are those that `draw` draws.
    """

    def __init__(self, contact: ContactPlant, meshcat: Meshcat) -> None:
        self._peg, self._meshcat = contact.peg, meshcat
        self._bodies = draw_bodies(meshcat, contact)
        self.pose = contact.plant.CreateDefaultContext()
        red, green, blue = (int(FORCE_COLOUR[i : i + 2], 16) / 255 for i in (1, 3, 5))
        self._arrow = Arrow(
            meshcat, "force_on_the_peg", scale=100.0 * NEWTONS_PER_CENTIMETRE, colour=Rgba(red, green, blue, 0.99)
        )

    def draw(self, force: Array, time: float) -> None:
        """Draws the bodies at ``pose`` and the contact force on the peg in W (3,), N, at a time of the recording, s."""
        for path, body in self._bodies.items():
            self._meshcat.SetTransform(path, body.EvalPoseInWorld(self.pose), time)
        self._arrow.draw(self._peg.EvalPoseInWorld(self.pose).translation(), force, time)


class RigDisplay(LeafSystem):
    """
    .. pydrake_system::

        name: RigDisplay
        input_ports:
        - carriage_state
        - gimbal_state
        - reaction_forces

    Publishes the bodies of the rig into Meshcat, and an arrow at the tip of the peg: the contact force, as what the
    mount holds beside the weight. The deflection of the mount is too small to see.

    Args:
        scenario: resolved.
        plant: whose ports are connected.
        meshcat: Meshcat to draw into.
        period: publishing period, s.
    """

    def __init__(self, scenario: Scenario, plant: RigPlant, meshcat: Meshcat, period: float) -> None:
        super().__init__()
        self._rig = AddRigPlant(DiagramBuilder(), scenario)
        self._picture = PlantPicture(self._rig, meshcat)
        self._weld, self._weight = plant.sensor, np.array([0.0, 0.0, plant.weight])
        self._carriage = self.DeclareVectorInputPort("carriage_state", 2)
        self._gimbal = self.DeclareVectorInputPort("gimbal_state", plant.gimbal_state.size())
        self._reaction = self.DeclareAbstractInputPort("reaction_forces", Value([SpatialForce.Zero()]))
        self.DeclarePeriodicPublishEvent(period, 0.0, self._publish)

    def _publish(self, context: Context) -> EventStatus:
        state = self._gimbal.Eval(context)
        angles = state[: len(state) // 2]
        self._rig.set_start(self._picture.pose, carriage=self._carriage.Eval(context)[0], angles=angles)
        held = self._reaction.Eval(context)[self._weld].translational()
        self._picture.draw(self._weight - held, context.get_time())
        return EventStatus.Succeeded()

    @staticmethod
    def AddToBuilder(
        builder: DiagramBuilder, scenario: Scenario, plant: RigPlant, meshcat: Meshcat, period: float
    ) -> None:
        """Adds the system to a diagram, and connects it with the plant."""
        display = builder.AddNamedSystem("rig_display", RigDisplay(scenario, plant, meshcat, period))
        for name in ("carriage_state", "gimbal_state", "reaction_forces"):
            builder.Connect(getattr(plant, name), display.GetInputPort(name))


class PegDisplay(LeafSystem):
    """
    .. pydrake_system::

        name: PegDisplay
        input_ports:
        - peg_state
        - contact_wrench

    Publishes peg and block of the virtual environment into Meshcat, and the contact force as an arrow at the tip.

    Args:
        scenario: resolved.
        meshcat: Meshcat to draw into.
        period: publishing period, s.
    """

    def __init__(self, scenario: Scenario, meshcat: Meshcat, period: float) -> None:
        super().__init__()
        self._environment = AddVirtualPlant(DiagramBuilder(), scenario)
        self._picture = PlantPicture(self._environment, meshcat)
        self._state = self.DeclareVectorInputPort("peg_state", 13)
        self._wrench = self.DeclareVectorInputPort("contact_wrench", 6)
        self.DeclarePeriodicPublishEvent(period, 0.0, self._publish)

    def _publish(self, context: Context) -> EventStatus:
        self._environment.set_start(self._picture.pose, free_body_pose(self._state.Eval(context)[:7]))
        self._picture.draw(self._wrench.Eval(context)[3:], context.get_time())
        return EventStatus.Succeeded()

    @staticmethod
    def AddToBuilder(
        builder: DiagramBuilder, scenario: Scenario, plant: PegPlant, meshcat: Meshcat, period: float
    ) -> None:
        """Adds the system to a diagram, and connects it with the plant."""
        display = builder.AddNamedSystem("peg_display", PegDisplay(scenario, meshcat, period))
        for name in ("peg_state", "contact_wrench"):
            builder.Connect(getattr(plant, name), display.GetInputPort(name))
