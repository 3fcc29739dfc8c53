"""The bodies of the rig in MuJoCo: an exact cylinder in a ring of boxes.

The faces of the boxes touch the true circle, so that the play of the round peg is exact (to 0.1 % between two faces).
Each side of the bore has three boxes: the wall, the chamfer, tilted by 45 degrees, and the face of the block above. The
floor lies below. A box is wider than its side; its ends lie within its neighbours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import mujoco
import numpy as np
from numpy.typing import ArrayLike
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from models.scenario import Geometry, Scenario
from skill.arrays import Array
from systems.plant.contact_plant import AddRigPlant

STEPS = 20
"""Steps of MuJoCo in a contact time step of a scenario."""

NOMINAL = Scenario()

PEG, BLOCK = 'contype="2" conaffinity="1"', 'contype="1" conaffinity="2"'


@dataclass(frozen=True)
class MujocoContact:
    """Parameters of MuJoCo's contact.

    The defaults are those of the nominal scenario; `of` gives those of another one. MuJoCo's contact has a prescribed
    acceleration, so that its compliance depends on the masses in contact: with the same parameters the overlap on the
    rig is several times that of the planar peg. It falls with the square of the time constant. A time constant of
    fewer than about twelve steps, or a higher impedance, makes a sliding peg chatter between the walls.

    Attributes:
        boxes: number of boxes in the ring.
        time_step: s.
        time_constant: of a contact's return to zero overlap, s; MuJoCo raises it to two time steps.
        impedance: part of a contact's acceleration that is removed as for rigid bodies.
        precision: of the distances between bodies, m. MuJoCo's own default of 1e-6 is as large as the overlaps here:
            the normals are then noise, and pegs stick where they should slide.
    """

    boxes: int = 64
    time_step: float = 1e-4
    time_constant: float = 1.2e-3
    impedance: float = 0.7
    precision: float = 1e-12

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """Returns the parameters with which the overlap keeps its part of the clearance under the guard's limit."""
        load = scenario.controller.guard.force_limit / NOMINAL.controller.guard.force_limit
        clearance = scenario.geometry.clearance / NOMINAL.geometry.clearance
        return cls(
            time_step=scenario.contact.time_step / STEPS, time_constant=cls.time_constant * math.sqrt(clearance / load)
        )


def document(contact: MujocoContact, friction: float, gravity: float, bodies: str, rest: str = "") -> str:
    """An MJCF document.

    Args:
        contact: parameters of the contact.
        friction: coefficient mu.
        gravity: m/s^2, along -z.
        bodies: MJCF elements of the world body.
        rest: further MJCF elements.
    """
    return f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{contact.time_step}" gravity="0 0 {-gravity}" cone="elliptic" integrator="implicitfast"
          ccd_tolerance="{contact.precision}" ccd_iterations="200"/>
  <default>
    <geom friction="{friction} 0 0" condim="3" solref="{contact.time_constant} 1"
          solimp="{contact.impedance} {contact.impedance} 1e-4"/>
  </default>
  <worldbody>{bodies}</worldbody>
  {rest}
</mujoco>"""


def bore(g: Geometry, boxes: int) -> str:
    """MJCF geoms of the block in H, with the given number of boxes around the bore."""
    thickness = g.block_radius - g.hole_radius - g.chamfer
    half = 0.5 * thickness
    width = g.block_radius * np.tan(np.pi / boxes)
    wall = 0.5 * (g.hole_depth - g.chamfer)
    slope = g.chamfer / np.sqrt(2.0)  # half the chamfer's length
    # (radius and height of the centre, tilt towards the axis, half sizes)
    sides = [(g.hole_radius + half, -g.chamfer - wall, 0.0, (half, wall))]
    if g.chamfer > 0:
        behind = half / np.sqrt(2.0)  # distance of the centre from the face, outward and down
        middle = (g.hole_radius + 0.5 * g.chamfer + behind, -0.5 * g.chamfer - behind)
        sides += [(*middle, np.pi / 4, (half, slope))]
        sides += [(g.hole_radius + g.chamfer + half, -0.5 * g.chamfer, 0.0, (half, 0.5 * g.chamfer))]
    geoms = []
    for k in range(boxes):
        about = 2.0 * np.pi * k / boxes
        for radius, z, tilt, (across, along) in sides:
            x, y = radius * np.cos(about), radius * np.sin(about)
            # A rotation about y, which tilts a wall outward, then about z.
            turn = np.cos(about / 2), np.sin(about / 2)
            lean = np.cos(tilt / 2), np.sin(tilt / 2)
            q = (turn[0] * lean[0], -turn[1] * lean[1], turn[0] * lean[1], turn[1] * lean[0])
            geoms.append(
                f'<geom type="box" {BLOCK} pos="{x:.12f} {y:.12f} {z:.12f}"'
                f' quat="{" ".join(f"{v:.15f}" for v in q)}" size="{across:.12f} {width:.12f} {along:.12f}"/>'
            )
    geoms.append(
        f'<geom type="box" {BLOCK} pos="0 0 {-g.hole_depth - 0.5 * g.floor}"'
        f' size="{g.block_radius} {g.block_radius} {0.5 * g.floor}"/>'
    )
    return "\n".join(geoms)


def peg(g: Geometry) -> str:
    """The MJCF geom of the peg in P."""
    return f'<geom type="cylinder" {PEG} size="{g.peg_radius} {0.5 * g.peg_length}" pos="0 0 {0.5 * g.peg_length}"/>'


def rig_document(scenario: Scenario, contact: MujocoContact) -> str:
    """The MJCF document of the rig: bodies with the masses and inertias of Drake's plant, mount, motors and sensor."""
    plant = AddRigPlant(DiagramBuilder(), scenario).plant
    g, rig, stepper, feed = scenario.geometry, scenario.rig, scenario.stepper, scenario.feed
    pivot = rig.pivot_height
    if pivot is None:
        raise ValueError("rig.pivot_height is not set; resolve the scenario first (`resolve_scenario`)")
    slide = f'type="slide" stiffness="{rig.mount_stiffness}" damping="{rig.mount_damping}"'
    bodies = f"""
    <body name="carriage">
      <joint name="feed" type="slide" axis="0 0 1" damping="{rig.carriage_friction}"
             armature="{feed.reflected_mass}"/>
      {_inertial(plant, "carriage")}
      <body name="mount_x"><joint name="mount_x" axis="1 0 0" {slide}/>{_inertial(plant, "mount_x")}
        <body name="mount_y"><joint name="mount_y" axis="0 1 0" {slide}/>{_inertial(plant, "mount_y")}
          <body name="peg" pos="0 0 {-scenario.sensor.height}">
            {_inertial(plant, "peg")}{peg(g)}
            <site name="sensor" pos="0 0 {scenario.sensor.height}"/>
          </body>
        </body>
      </body>
    </body>
    <body name="pitch_ring" pos="0 0 {pivot}">
      <joint name="pitch" type="hinge" axis="1 0 0" armature="{stepper.reflected_inertia}"/>
      {_inertial(plant, "pitch_ring")}
      <body name="yaw_ring">
        <joint name="yaw" type="hinge" axis="0 1 0" armature="{stepper.reflected_inertia}"/>
        {_inertial(plant, "yaw_ring")}
        <body name="block" pos="0 0 {-pivot}">{_inertial(plant, "block")}{bore(g, contact.boxes)}</body>
      </body>
    </body>"""
    spring = (
        f'kp="{stepper.stiffness}" kv="{stepper.damping}"'
        f' forcerange="{-stepper.holding_torque} {stepper.holding_torque}"'
    )
    rest = f"""
  <actuator>
    <motor joint="feed"/>
    <position joint="pitch" {spring}/>
    <position joint="yaw" {spring}/>
  </actuator>
  <sensor><force site="sensor"/><torque site="sensor"/></sensor>"""
    gravity = float(np.linalg.norm(plant.gravity_field().gravity_vector()))
    return document(contact, scenario.contact.friction, gravity, bodies, rest)


def peg_document(scenario: Scenario, contact: MujocoContact) -> str:
    """The MJCF document of a free peg, with the coupling's virtual mass and inertia about its tip, in a fixed bore."""
    g, coupling = scenario.geometry, scenario.coupling
    inertia = " ".join(3 * [f"{coupling.peg_inertia}"])
    bodies = f"""
    {bore(g, contact.boxes)}
    <body name="peg">
      <freejoint/>
      <inertial pos="0 0 0" mass="{coupling.peg_mass}" diaginertia="{inertia}"/>
      {peg(g)}
    </body>"""
    return document(contact, scenario.contact.friction, 0.0, bodies)


def forces_on_the_peg(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, Array, Array]:
    """Returns points, unit normals towards the peg, and forces on the peg, of the n contacts of the last step.

    Each is (n, 3), in W, in m and N.
    """
    found, local = data.contact, np.zeros((data.ncon, 6))
    for k in range(data.ncon):
        mujoco.mj_contactForce(model, data, k, local[k])
    # A contact's normal points from its first to its second geom; the one of a cylinder is the peg.
    second = model.geom_type[found.geom[:, 1]] == mujoco.mjtGeom.mjGEOM_CYLINDER
    frames = np.where(second[:, None, None], 1.0, -1.0) * found.frame.reshape(-1, 3, 3)
    return np.array(found.pos), frames[:, 0], np.einsum("nij,ni->nj", frames, local[:, :3])


def _inertial(plant: MultibodyPlant, name: str) -> str:
    inertia = plant.GetBodyByName(name).default_spatial_inertia()
    centre = inertia.get_com()
    I = inertia.Shift(centre).CalcRotationalInertia()  # noqa: E741  (the usual symbol)
    moments, products = I.get_moments(), I.get_products()
    numbers = {"pos": centre, "fullinertia": [*moments, *products]}
    return f'<inertial mass="{inertia.get_mass()}" {" ".join(_attribute(k, v) for k, v in numbers.items())}/>'


def _attribute(name: str, values: ArrayLike) -> str:
    return f'{name}="{" ".join(f"{v:.12g}" for v in np.asarray(values))}"'
