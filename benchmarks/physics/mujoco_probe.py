"""A planar probe in MuJoCo: an exact cylinder in a ring of boxes.

The faces of the boxes touch the true circle, so that the play of the round peg is exact (to 0.1 % between two faces).
Each side of the bore has three boxes: the wall, the chamfer, tilted by 45 degrees, and the face of the block above. The
floor lies below. A box is wider than its side; its ends lie within its neighbours.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from benchmarks.physics.contact_probe import AXES, PlanarPose
from models.scenario import Geometry, Scenario
from skill.arrays import Array

PEG, BLOCK = 'contype="2" conaffinity="1"', 'contype="1" conaffinity="2"'


@dataclass(frozen=True)
class MujocoContact:
    """Parameters of MuJoCo's contact.

    MuJoCo's contact has a prescribed acceleration, so that its compliance depends on the masses in contact. The overlap
    falls with the square of the time constant. A time constant of fewer than about twelve steps, or a higher impedance,
    makes a sliding peg chatter between the walls.

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


def document(contact: MujocoContact, friction: float, gravity: float, bodies: str) -> str:
    """An MJCF document.

    Args:
        contact: parameters of the contact.
        friction: coefficient mu.
        gravity: m/s^2, along -z.
        bodies: MJCF elements of the world body.
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


class MujocoProbe:
    """A `benchmarks.physics.contact_probe.PlanarProbe` in MuJoCo; the middle of a box lies in the plane of motion.

    Args:
        scenario: geometry of the bodies and friction.
        contact: parameters of the contact.
        mass: of the peg, kg.
        inertia: of the peg about its tip, kg m^2.
        damping: of x, z and tilt, N s/m, N s/m and N m s/rad.
    """

    scale = 1.0

    def __init__(
        self,
        scenario: Scenario,
        contact: MujocoContact,
        *,
        mass: float = 0.5,
        inertia: float = 1e-4,
        damping: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        self.time_step = contact.time_step
        g = scenario.geometry
        kinds = ('type="slide" axis="1 0 0"', 'type="slide" axis="0 0 1"', 'type="hinge" axis="0 1 0"')
        drag = np.asarray(damping, dtype=float)
        joints = "".join(
            f'<joint name="{name}" {kind} damping="{d}"/>' for name, kind, d in zip(AXES, kinds, drag, strict=True)
        )
        own = f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>'
        bodies = f"{bore(g, contact.boxes)}<body>{joints}{own}{peg(g)}</body>"
        self.model = mujoco.MjModel.from_xml_string(document(contact, scenario.contact.friction, 0.0, bodies))
        self.data = mujoco.MjData(self.model)
        self._damping = copy.deepcopy(self.model.dof_damping)

    def place(self, pose: PlanarPose) -> None:
        """See `PlanarProbe`."""
        load = self.data.qfrc_applied.copy()
        mujoco.mj_resetData(self.model, self.data)
        self.data.qfrc_applied[:] = load
        self.data.qpos[:] = [pose.x, pose.z, pose.tilt]

    def load(self, force_x: float, force_z: float, moment: float) -> None:
        """See `PlanarProbe`."""
        self.data.qfrc_applied[:] = [force_x, force_z, moment]

    def hold(self, *names: str) -> None:
        """Locks the named freedoms of `AXES` by a very large inertia and damping, and frees the others."""
        held = np.array([name in names for name in AXES])
        self.model.dof_armature[:] = np.where(held, 1e6, 0.0)
        self.model.dof_damping[:] = np.where(held, 1e9, self._damping)
        mujoco.mj_setConst(self.model, mujoco.MjData(self.model))

    def step(self, count: int = 1) -> None:
        """See `PlanarProbe`."""
        mujoco.mj_step(self.model, self.data, nstep=count)

    def pose(self) -> PlanarPose:
        """See `PlanarProbe`."""
        return PlanarPose(*(float(v) for v in self.data.qpos))

    def velocity(self) -> Array:
        """See `PlanarProbe`."""
        return np.array(self.data.qvel)

    def contact_load(self) -> Array:
        """See `PlanarProbe`."""
        return np.array(self.data.qfrc_constraint)
