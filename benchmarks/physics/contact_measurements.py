"""Measurements of the simulated contact in cases that have a theory (`models.contact_theory`).

Every measurement moves a `ContactProbe`. Lengths are in m, angles in rad, forces in N. The depth l or h is that of the
tip's centre below the mouth, the inner edge of the chamfer.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.physics.contact_probe import ContactProbe, PlanarPose, PlanarProbe
from models.assembly import Assembly
from models.contact_theory import (
    jamming_load,
    slenderness,
    two_point_axial_force,
    two_point_depth,
    two_point_tilt,
    wedging_tilt,
)
from models.exact_geometry import rotations_of_vectors
from models.scenario import Scenario
from models.section import rounded_corners
from skill.arrays import Array

PRISMS = {
    "square": 0.0,
    "square, diagonal": 45.0,
    "rectangle": 0.0,
    "hexagon": 30.0,
    "hexagon, diagonal": 0.0,
}
"""Planes in which a prism moves as in the theory: a named polygon, and by how much it is turned about its axis, deg.
The plane halves two opposite sides, or on a diagonal two opposite corners."""

CRAWLING: dict[str, Any] = {"mass": 0.15, "inertia": 3e-5, "damping": (5.0, 400.0, 0.01)}
"""A probe whose large damping of z makes the peg slide slowly, so that inertia and the damping of the tilt are
negligible in the force balance."""

PRESSED: dict[str, Any] = {"mass": 0.5, "damping": (5.0, 40.0, 0.0)}
"""A probe that comes to rest under a push."""

LIGHT, FIRM = 4e-3, 0.2
"""Moments on a peg that slides slowly, N m: at a depth of 20 mm they press each contact with 0.2 N or 10 N."""

REST = 0.1
"""Time after which a pushed peg is at rest, s."""

SETTLE, SLIDE = 0.03, 0.10
"""Time for which the peg settles sideways at constant height, and time for which it may then slide, s."""

SLIDING_SPEED = 1e-3
"""Minimum speed of a sliding peg, m/s. A stuck contact creeps at a thousandth of it; under a load 5 % inside the edges
of the jamming diagram the peg reaches ten times this speed."""

AXIAL_FORCE = 0.3
"""Axial force of the jamming trials, N; small, so that contact patches are narrow, as the planar theory assumes."""

MARGIN = 0.05
"""Distance of a load from the edges of the jamming diagram within which it may slide or stick."""

MIN_KEPT_SQUEEZE = 0.9
"""Minimum part of its squeeze that a wedged peg keeps."""


def prism_in(plane: str) -> Scenario:
    """Returns the scenario of a prism that moves in one of `PRISMS`."""
    scenario = Scenario()
    scenario.geometry.corners = rounded_corners(plane.split(",")[0], math.radians(PRISMS[plane]))
    return scenario


def converged(scenario: Scenario, friction: float) -> Scenario:
    """The scenario with shorter steps and a softer contact than the default, with which the laws are measured."""
    finer = copy.deepcopy(scenario)
    finer.contact.friction = friction
    finer.contact.modulus = 3e10
    # At 5e-4 s a line contact under a tilting load rocks, and sticks where it should slide.
    finer.contact.time_step = 2.5e-4
    return finer


@dataclass(frozen=True)
class PegTheory:
    """The sizes in the equations of the theory, m.

    Attributes:
        r: radius of the peg; of another section, how far it extends along x, which must be as far as along -x.
        R: likewise of the hole.
        mouth: height of the mouth in H.
    """

    r: float
    R: float
    mouth: float

    @classmethod
    def of(cls, scenario: Scenario) -> PegTheory:
        """The sizes of a scenario's geometry."""
        bodies = scenario.geometry.assembly.fits[0]
        return cls(bodies.peg.reach(1.0, 0.0), bodies.hole.reach(1.0, 0.0), -bodies.chamfer)

    def two_point_pose(self, tilt: float, depth: float) -> PlanarPose:
        """The pose with the tip's upper edge on the wall; at depth h(tilt) the peg also touches the mouth."""
        side = np.copysign(1.0, tilt)
        return PlanarPose(-side * (self.R - self.r * np.cos(tilt)), self.mouth - depth, tilt)


def measured_two_point_depth(probe: ContactProbe, sizes: PegTheory, tilt: float) -> float:
    """Depth at which the sideways play of the tilted peg is zero, m, from the meshes alone.

    The play between tip and wall and between side and mouth falls linearly with depth. It is measured at two shallower
    depths and extrapolated to zero, where both touch.
    """
    h = float(two_point_depth(tilt, peg_radius=sizes.r, hole_radius=sizes.R))
    upper = sizes.r * np.sin(tilt)  # height of the touching edge of the tip above its centre
    depths = upper + np.array([0.5, 0.9]) * (h - upper)
    play = [_play(probe, sizes, tilt, depth) for depth in depths]
    return float(depths[0] + (depths[1] - depths[0]) * play[0] / (play[0] - play[1]))


def _play(probe: ContactProbe, sizes: PegTheory, tilt: float, depth: float) -> float:
    """Sideways play of the tilted peg, m, by bisection to 1e-9 m."""
    tip = sizes.r * np.cos(tilt) - sizes.R
    mouth = sizes.R - sizes.r / np.cos(tilt) - depth * np.tan(tilt)
    ends = []
    for reach in (-6.0 * (sizes.R - sizes.r), 6.0 * (sizes.R - sizes.r)):
        free, touching = 0.5 * (tip + mouth), 0.5 * (tip + mouth) + reach
        while abs(touching - free) > 1e-9:
            middle = 0.5 * (free + touching)
            probe.place(PlanarPose(middle, sizes.mouth - depth, tilt))
            free, touching = (free, middle) if probe.touches() else (middle, touching)
        ends.append(free)
    return float(ends[1] - ends[0])


def jamming_agreement(
    scenario: Scenario,
    friction: float,
    *,
    depth: float,
    count: int,
    seed: int,
    engine: Callable[..., PlanarProbe] = ContactProbe,
) -> float:
    """Share of random loads that slide or stick as the jamming diagram predicts.

    The loads are uniform over an area 1.5 times the parallelogram in both directions; those within 5 % of its edges do
    not count.

    Args:
        scenario: geometry of the bodies.
        friction: coefficient mu.
        depth: l, m.
        count: number of trials.
        seed: seed of the loads.
        engine: makes the probe.
    """
    sizes = PegTheory.of(scenario)
    lam = float(slenderness(depth, peg_radius=sizes.r, friction=friction))
    rng = np.random.default_rng(seed)
    edge, two_point = rng.uniform(-1.5, 1.5, (2, count))
    x = edge / friction
    m = lam * two_point - friction * (1.0 + lam) * x
    probe = engine(converged(scenario, friction), mass=0.15, inertia=3e-5, damping=(5.0, 0.0, 0.05))
    slid = np.array([_slides(probe, sizes, depth, a, b, np.sign(s)) for a, b, s in zip(x, m, two_point, strict=True)])
    load = jamming_load(x, m, slenderness=lam, friction=friction)
    return float(((load < 1.0) == slid)[np.abs(load - 1.0) > MARGIN].mean())


def _slides(probe: PlanarProbe, sizes: PegTheory, depth: float, x: float, m: float, side: float) -> bool:
    """Whether the peg slides under F_x / F_z = x and M / (r F_z) = m; ``side`` is the sign of its tilt."""
    tilt = side * two_point_tilt(depth, peg_radius=sizes.r, hole_radius=sizes.R)
    probe.hold()
    probe.place(sizes.two_point_pose(tilt, depth))
    # Whitney's F_x points from the contact at the mouth to that at the tip: along -x for a positive tilt.
    lateral, moment = -AXIAL_FORCE * x, AXIAL_FORCE * m * sizes.r
    probe.load(lateral, 0.0, moment)
    probe.hold("z")
    probe.step(round(SETTLE / probe.time_step))
    probe.hold()
    probe.load(lateral, -AXIAL_FORCE, moment)
    for _ in range(10):
        probe.step(round(SLIDE / 10 / probe.time_step))
        if probe.velocity()[1] < -10.0 * SLIDING_SPEED:
            return True
    return bool(probe.velocity()[1] < -SLIDING_SPEED)


def force_balance(
    scenario: Scenario,
    friction: float,
    *,
    depth: float,
    shares: ArrayLike = (0.0, 0.25, 0.5, 0.75, 0.9),
    engine: Callable[..., PlanarProbe] = ContactProbe,
) -> tuple[Array, Array]:
    """Axial force of slow sliding in two-point contact, N: predicted (n,) and measured (n,).

    Args:
        scenario: geometry of the bodies.
        friction: coefficient mu.
        depth: l, m.
        shares: (n,), part of the load of 4 mN m that is a lateral force F_x = share * 4 mN m / l; the rest is a moment.
        engine: makes the probe.
    """
    sizes = PegTheory.of(scenario)
    probe = engine(converged(scenario, friction), **CRAWLING)
    forces = []
    for share in np.asarray(shares, dtype=float):
        moment, lateral = 4e-3 * (1.0 - share), 4e-3 * share / depth
        predicted, resisted = crawl(probe, sizes, friction, lateral=lateral, moment=moment, depth=depth)
        forces.append((predicted, float(np.mean(resisted))))
    predicted_all, measured_all = np.array(forces).T
    return predicted_all, measured_all


def crawl(
    probe: PlanarProbe, sizes: PegTheory, friction: float, *, lateral: float, moment: float, depth: float
) -> tuple[float, Array]:
    """Axial force of a peg that slides slowly under a constant load in two-point contact.

    Args:
        probe: with the parameters `CRAWLING`.
        sizes: of the bodies.
        friction: coefficient mu.
        lateral: F_x with Whitney's sign, N.
        moment: M about the tip, N m.
        depth: l at the start, m.

    Returns:
        The predicted force at the depth where the peg ends, N, and the force measured over the last 40 ms, (20,), N.
    """
    law = {"peg_radius": sizes.r, "friction": friction}
    tilt = two_point_tilt(depth, peg_radius=sizes.r, hole_radius=sizes.R)
    expected = float(two_point_axial_force(lateral, moment, depth=depth, **law))
    probe.hold()
    probe.place(sizes.two_point_pose(tilt, depth))
    probe.load(-lateral, -2.0 * expected, moment)
    probe.step(round(0.15 / probe.time_step))
    resisted = []
    for _ in range(20):
        probe.step(round(2e-3 / probe.time_step))
        resisted.append(float(probe.contact_load()[1]))
    now = sizes.mouth - probe.pose().z
    return float(two_point_axial_force(lateral, moment, depth=now, **law)), np.array(resisted)


def press(probe: PlanarProbe, sizes: PegTheory, bodies: Assembly, tilt: float, force: float) -> tuple[float, float]:
    """Pushes the peg at a fixed tilt until it is at rest.

    Args:
        probe: moves the peg.
        sizes: of the bodies.
        bodies: the round bodies whose overlap is measured.
        tilt: rad.
        force: axial push, N.

    Returns:
        The error of the depth relative to h, and the overlap of the round bodies, m.
    """
    h = float(two_point_depth(tilt, peg_radius=sizes.r, hole_radius=sizes.R))
    probe.hold()
    start = sizes.two_point_pose(tilt, h - 2e-5)
    probe.place(PlanarPose(start.x + 1e-7, start.z, tilt))
    probe.hold("tilt")
    probe.load(0.0, -force, 0.0)
    probe.step(round(REST / probe.time_step))
    pose = probe.pose()
    gap = bodies.gap([[pose.x, 0.0, pose.z]], rotations_of_vectors([[0.0, pose.tilt, 0.0]]))[0]
    return (sizes.mouth - pose.z) / h - 1.0, max(0.0, -float(gap))


def squeeze_kept(probe: PlanarProbe, sizes: PegTheory, tilt: float) -> float:
    """Part of its squeeze that a peg in two-point contact keeps 20 ms after the moment on it is removed.

    The squeeze is the tilt beyond that at which both contacts close. The moment presses each contact with 1 N.

    Args:
        probe: without damping of x and z, which would hold the peg.
        sizes: of the bodies.
        tilt: at which both contacts close, rad.
    """

    def squeeze() -> float:
        pose, scale = probe.pose(), probe.scale
        free = two_point_tilt(sizes.mouth - pose.z, peg_radius=sizes.r * scale, hole_radius=sizes.R * scale)
        return pose.tilt - free

    depth = float(two_point_depth(tilt, peg_radius=sizes.r, hole_radius=sizes.R))
    probe.hold()
    probe.place(sizes.two_point_pose(tilt, depth))
    probe.load(0.0, 0.0, depth)
    probe.step(round(SETTLE / probe.time_step))
    loaded = squeeze()
    for part in (0.8, 0.6, 0.4, 0.2):
        probe.load(0.0, 0.0, part * depth)
        probe.step(round(0.004 / probe.time_step))
    probe.load(0.0, 0.0, 0.0)
    probe.step(round(0.024 / probe.time_step))
    return squeeze() / loaded


def measured_wedging_tilt(
    scenario: Scenario,
    friction: float,
    *,
    engine: Callable[..., PlanarProbe] = ContactProbe,
) -> float:
    """Minimum tilt at which a squeezed peg stays squeezed, rad.

    The contact is stiffer than `converged`; ``engine`` makes the probe. The tilt is NaN if the peg does not change from
    slipping to holding within the tilts that the bore allows.
    """
    sizes = PegTheory.of(scenario)
    finer = converged(scenario, friction)
    finer.contact.modulus = 1e11
    probe = engine(finer, mass=0.15, inertia=3e-5, damping=(0.0, 0.0, 0.002))
    law = wedging_tilt(peg_radius=sizes.r, hole_radius=sizes.R, friction=friction)
    # Two-point contact must begin above the floor of the bore, and at a tilt that still enters.
    deepest = 0.95 * (scenario.geometry.hole_depth - scenario.geometry.chamfer)
    shallowest = two_point_tilt(deepest, peg_radius=sizes.r, hole_radius=sizes.R)
    free, wedged = max(0.7 * law, shallowest), min(1.6 * law, 0.9 * float(np.arccos(sizes.r / sizes.R)))

    def holds(tilt: float) -> bool:
        return squeeze_kept(probe, sizes, tilt) >= MIN_KEPT_SQUEEZE

    if not free < wedged or holds(free) or not holds(wedged):
        return math.nan
    while wedged - free > 0.005 * law:
        middle = 0.5 * (free + wedged)
        free, wedged = (free, middle) if holds(middle) else (middle, wedged)
    return 0.5 * (free + wedged)
