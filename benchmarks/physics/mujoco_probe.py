"""A planar probe in MuJoCo: an exact cylinder in a ring of boxes.

    python -m benchmarks.physics.mujoco_probe [--json FILE]

Prints the error of the depth at which a peg with a tilt of 1 degree comes to rest under 5 N, and the overlap, um; and
for slow slides with 4 mN m and 0.2 N m on the peg at depths of 10 and 20 mm the error of the axial force relative to
Whitney's balance. Needs the extra [peers].

The faces of the boxes touch the true circle, so that the play of the round peg is exact (to 0.1 % between two faces).
Each side of the bore has three boxes: the wall, the chamfer, tilted by 45 degrees, and the face of the block above. The
floor lies below. A box is wider than its side; its ends lie within its neighbours.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import ArrayLike

from benchmarks.command_line import JsonFile, finish, run
from benchmarks.physics.contact_measurements import CRAWLING, FIRM, LIGHT, PRESSED, PegTheory, crawl, press
from benchmarks.physics.contact_probe import AXES, PlanarPose
from models.scenario import Geometry, Scenario
from skill.arrays import Array

PEG, BLOCK = 'contype="2" conaffinity="1"', 'contype="1" conaffinity="2"'


BOXES = 64
"""Number of boxes in the ring."""

TIME_STEP, TIME_CONSTANT, IMPEDANCE = 1e-4, 1.2e-3, 0.7
"""Step (s), and of a contact: the time of its return to zero overlap (s) and the part of its acceleration that is
removed as for rigid bodies.

MuJoCo's contact has a prescribed acceleration, so that its compliance depends on the masses in contact. The overlap
falls with the square of the time constant. A time constant of fewer than about twelve steps, or a higher impedance,
makes a sliding peg chatter between the walls."""

PRECISION = 1e-12
"""Of the distances between bodies, m. MuJoCo's own default of 1e-6 is as large as the overlaps here: the normals are
then noise, and pegs stick where they should slide."""


def document(friction: float, bodies: str) -> str:
    """An MJCF document without gravity: the coefficient of friction, and the elements of the world body."""
    return f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{TIME_STEP}" gravity="0 0 0" cone="elliptic" integrator="implicitfast"
          ccd_tolerance="{PRECISION}" ccd_iterations="200"/>
  <default>
    <geom friction="{friction} 0 0" condim="3" solref="{TIME_CONSTANT} 1" solimp="{IMPEDANCE} {IMPEDANCE} 1e-4"/>
  </default>
  <worldbody>{bodies}</worldbody>
</mujoco>"""


def bore(g: Geometry) -> str:
    """MJCF geoms of the block in H."""
    thickness = g.block_radius - g.hole_radius - g.chamfer
    half = 0.5 * thickness
    width = g.block_radius * np.tan(np.pi / BOXES)
    wall = 0.5 * (g.hole_depth - g.chamfer)
    slope = g.chamfer / np.sqrt(2.0)  # half the chamfer's length
    # (radius and height of the centre, tilt towards the axis, half sizes)
    behind = half / np.sqrt(2.0)  # distance of the chamfer's centre from its face, outward and down
    middle = (g.hole_radius + 0.5 * g.chamfer + behind, -0.5 * g.chamfer - behind)
    sides = [
        (g.hole_radius + half, -g.chamfer - wall, 0.0, (half, wall)),
        (*middle, np.pi / 4, (half, slope)),
        (g.hole_radius + g.chamfer + half, -0.5 * g.chamfer, 0.0, (half, 0.5 * g.chamfer)),
    ]
    geoms = []
    for k in range(BOXES):
        about = 2.0 * np.pi * k / BOXES
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


class MujocoProbe:
    """A `benchmarks.physics.contact_probe.PlanarProbe` in MuJoCo; the middle of a box lies in the plane of motion.

    Args:
        scenario: geometry of the bodies and friction.
        mass: of the peg, kg.
        inertia: of the peg about its tip, kg m^2.
        damping: of x, z and tilt, N s/m, N s/m and N m s/rad.
    """

    scale = 1.0

    def __init__(
        self,
        scenario: Scenario,
        *,
        mass: float = 0.5,
        inertia: float = 1e-4,
        damping: ArrayLike = (0.0, 0.0, 0.0),
    ) -> None:
        self.time_step, g = TIME_STEP, scenario.geometry
        kinds = ('type="slide" axis="1 0 0"', 'type="slide" axis="0 0 1"', 'type="hinge" axis="0 1 0"')
        drag = np.asarray(damping, dtype=float)
        joints = "".join(
            f'<joint name="{name}" {kind} damping="{d}"/>' for name, kind, d in zip(AXES, kinds, drag, strict=True)
        )
        own = f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>'
        half = 0.5 * g.peg_length
        peg = f'<geom type="cylinder" {PEG} size="{g.peg_radius} {half}" pos="0 0 {half}"/>'
        bodies = f"{bore(g)}<body>{joints}{own}{peg}</body>"
        self.model = mujoco.MjModel.from_xml_string(document(scenario.contact.friction, bodies))
        self.data = mujoco.MjData(self.model)
        self._damping = drag

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


def main(json: JsonFile = None) -> None:
    scenario = Scenario()
    sizes, friction = PegTheory.of(scenario), scenario.contact.friction
    rest, overlap = press(
        MujocoProbe(scenario, **PRESSED), sizes, scenario.geometry.assembly, tilt=np.radians(1.0), force=5.0
    )
    found = {"depth_error": rest, "overlap_um": 1e6 * overlap}
    for name, moment in (("light", LIGHT), ("firm", FIRM)):
        for depth in (0.010, 0.020):
            probe = MujocoProbe(scenario, **CRAWLING)
            predicted, measured = crawl(probe, sizes, friction, lateral=0.0, moment=moment, depth=depth)
            found[f"{name}_{1e3 * depth:.0f}mm"] = float(measured.mean()) / predicted - 1.0
    for name, value in found.items():
        print(f"{name:12} {value:.4f}")
    finish(found, json)


if __name__ == "__main__":
    run(main)
