"""What the simulated contact does in the cases for which there is a theory: see `models.contact_theory`.

Every measurement moves a `ContactProbe`; lengths in m, angles in rad, forces in N. The depth l or h is that of the
tip's centre below the mouth, which is the inner edge of the chamfer.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks.physics.contact_probe import ContactProbe, PlanarPose
from models.contact_theory import (
    jamming_load,
    slenderness,
    two_point_axial_force,
    two_point_depth,
    two_point_tilt,
    wedging_tilt,
)
from models.scenario import Scenario
from skill.arrays import Array

# The drag on z makes the peg crawl, so that no inertia and no drag on the tilt enters the balance.
CRAWLING: dict[str, Any] = {"mass": 0.15, "inertia": 3e-5, "damping": (5.0, 400.0, 0.01)}
SETTLE, SLIDE = 0.03, 0.10
"""s: the peg settles sideways with its height held, then it is let go."""

SLIDING_SPEED = 1e-3
"""m/s. A stuck contact creeps a thousand times slower; a load 5 % inside the edges reaches ten times this."""

AXIAL_FORCE = 0.3
"""N. Small, so that a contact patch is narrow and its normals are nearly parallel, as the plane theory has them."""

KEPT = 0.9
"""Part of its squeeze that a wedged peg keeps."""


def converged(scenario: Scenario, friction: float) -> Scenario:
    """The scenario with contact as stiff and steps as short as the theory's rigid bodies need."""
    finer = copy.deepcopy(scenario)
    finer.contact.friction = friction
    finer.contact.modulus = 3e10
    # At 5e-4 s a line contact under a tilting load rocks, and holds where it should slide.
    finer.contact.time_step = 2.5e-4
    return finer


@dataclass(frozen=True)
class PegTheory:
    """The sizes that the laws need, from a scenario."""

    r: float
    R: float
    mouth: float

    @classmethod
    def of(cls, scenario: Scenario) -> PegTheory:
        """From the scenario's geometry."""
        g = scenario.geometry
        return cls(g.peg_radius, g.hole_radius, -g.chamfer)

    def two_point_pose(self, tilt: float, depth: float) -> PlanarPose:
        """With the tip's upper edge on the wall; the other contact is at the mouth if the depth is h(tilt)."""
        side = np.copysign(1.0, tilt)
        return PlanarPose(-side * (self.R - self.r * np.cos(tilt)), self.mouth - depth, tilt)


def measured_two_point_depth(probe: ContactProbe, sizes: PegTheory, tilt: float) -> float:
    """Depth at which the sideways play of the tilted peg ends, from the meshes alone.

    The play between tip on the wall and side on the mouth is measured at two shallower depths. It falls linearly
    with depth, and where it reaches zero both touch.
    """
    h = float(two_point_depth(tilt, peg_radius=sizes.r, hole_radius=sizes.R))
    upper = sizes.r * np.sin(tilt)  # of the tip's edge that touches, above its centre
    depths = upper + np.array([0.5, 0.9]) * (h - upper)
    play = [_play(probe, sizes, tilt, depth) for depth in depths]
    return float(depths[0] + (depths[1] - depths[0]) * play[0] / (play[0] - play[1]))


def _play(probe: ContactProbe, sizes: PegTheory, tilt: float, depth: float) -> float:
    tip = sizes.r * np.cos(tilt) - sizes.R
    mouth = sizes.R - sizes.r / np.cos(tilt) - depth * np.tan(tilt)
    ends = []
    for reach in (-3e-4, 3e-4):
        free, touching = 0.5 * (tip + mouth), 0.5 * (tip + mouth) + reach
        while abs(touching - free) > 1e-9:
            middle = 0.5 * (free + touching)
            probe.place(PlanarPose(middle, sizes.mouth - depth, tilt))
            free, touching = (free, middle) if probe.touches() else (middle, touching)
        ends.append(free)
    return ends[1] - ends[0]


def measured_entry_tilt(probe: ContactProbe, sizes: PegTheory) -> float:
    """Largest tilt at which the tip passes the mouth.

    There the upper edge of the tip is still at the mouth when both contacts close. Its depth h - r sin(theta) is
    measured at three smaller tilts and continued to zero by a parabola.
    """
    limit = float(np.arccos(sizes.r / sizes.R))
    tilts = limit * np.array([0.80, 0.87, 0.94])
    depth = [measured_two_point_depth(probe, sizes, t) - sizes.r * np.sin(t) for t in tilts]
    roots = np.roots(np.polyfit(tilts, depth, 2))
    return float(min(roots.real, key=lambda t: abs(t - limit)))


@dataclass(frozen=True)
class JammingTrials:
    """Trials in the jamming diagram.

    Attributes:
        force: (n,) F_x / F_z in Whitney's sense.
        moment: (n,) M / (r F_z).
        load: (n,) `jamming_load`: below 1 the peg is predicted to slide.
        slid: (n,) whether it did.
        slenderness: lambda.
    """

    force: Array
    moment: Array
    load: Array
    slid: NDArray[np.bool_]
    slenderness: float

    def agreement(self, margin: float = 0.05) -> float:
        """Part of the trials that went as predicted, of those further than ``margin`` from the edges."""
        clear = np.abs(self.load - 1.0) > margin
        return float(((self.load < 1.0) == self.slid)[clear].mean())


def jamming_trials(
    scenario: Scenario, friction: float, *, depth: float, count: int, seed: int, reach: float = 1.5
) -> JammingTrials:
    """Loads spread evenly over the parallelogram and its surroundings, ``reach`` times its size."""
    sizes = PegTheory.of(scenario)
    lam = float(slenderness(depth, peg_radius=sizes.r, friction=friction))
    rng = np.random.default_rng(seed)
    edge, two_point = rng.uniform(-reach, reach, (2, count))
    x = edge / friction
    m = lam * two_point - friction * (1.0 + lam) * x
    probe = ContactProbe(converged(scenario, friction), mass=0.15, inertia=3e-5, damping=(5.0, 0.0, 0.05))
    slid = np.array([_slides(probe, sizes, depth, a, b, np.sign(s)) for a, b, s in zip(x, m, two_point, strict=True)])
    return JammingTrials(x, m, jamming_load(x, m, slenderness=lam, friction=friction), slid, lam)


def _slides(probe: ContactProbe, sizes: PegTheory, depth: float, x: float, m: float, side: float) -> bool:
    tilt = side * two_point_tilt(depth, peg_radius=sizes.r, hole_radius=sizes.R)
    probe.hold()
    probe.place(sizes.two_point_pose(tilt, depth))
    # Whitney's F_x points from the mouth's contact to the tip's, against our x for a positive tilt.
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
    scenario: Scenario, friction: float, *, depth: float, shares: ArrayLike = (0.0, 0.25, 0.5, 0.75, 0.9)
) -> tuple[Array, Array]:
    """Axial force of slow sliding in two-point contact, predicted and measured, N.

    Args:
        scenario: of the bodies.
        friction: mu.
        depth: l, m.
        shares: of the lateral force in mu d F_x / M, against which the formula is linear.
    """
    sizes = PegTheory.of(scenario)
    probe = ContactProbe(converged(scenario, friction), **CRAWLING)
    forces = []
    for share in np.asarray(shares, dtype=float):
        moment, lateral = 4e-3 * (1.0 - share), 4e-3 * share / depth
        predicted, resisted = crawl(probe, sizes, friction, lateral=lateral, moment=moment, depth=depth)
        forces.append((predicted, float(np.mean(resisted))))
    predicted_all, measured_all = np.array(forces).T
    return predicted_all, measured_all


class PlanarProbe(Protocol):
    """What a measurement moves: `ContactProbe` has it, and so may a probe of another engine."""

    time_step: float

    def place(self, pose: PlanarPose) -> None:
        """See `ContactProbe`."""

    def load(self, force_x: float, force_z: float, moment: float) -> None:
        """See `ContactProbe`."""

    def hold(self, *names: str) -> None:
        """See `ContactProbe`."""

    def step(self, count: int = 1) -> None:
        """See `ContactProbe`."""

    def pose(self) -> PlanarPose:
        """See `ContactProbe`."""

    def contact_load(self) -> Array:
        """See `ContactProbe`."""


def crawl(
    probe: PlanarProbe, sizes: PegTheory, friction: float, *, lateral: float, moment: float, depth: float
) -> tuple[float, Array]:
    """Axial force of a peg that slides slowly under a constant load in two-point contact.

    Args:
        probe: with the freedoms of `CRAWLING`.
        sizes: of the bodies.
        friction: mu.
        lateral: F_x in Whitney's sense, N.
        moment: M about the tip, N m.
        depth: l, m, at the start.

    Returns:
        the predicted force, N, where the peg ends, and the 20 measured over the last 40 ms.
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


def squeeze_kept(probe: ContactProbe, sizes: PegTheory, tilt: float, push: float = 1.0) -> float:
    """What part of its squeeze a peg in two-point contact keeps 20 ms after a moment on it has gone.

    Args:
        probe: undamped, or the damping would hold the peg.
        sizes: of the bodies.
        tilt: rad.
        push: N, normal force at each contact under the moment.
    """
    facets = probe.facets
    shrunk = np.cos(np.pi / facets)

    def squeeze() -> float:
        pose = probe.pose()
        free = two_point_tilt(sizes.mouth - pose.z, peg_radius=sizes.r * shrunk, hole_radius=sizes.R * shrunk)
        return pose.tilt - free

    depth = float(two_point_depth(tilt, peg_radius=sizes.r, hole_radius=sizes.R))
    probe.hold()
    probe.place(sizes.two_point_pose(tilt, depth))
    probe.load(0.0, 0.0, push * depth)
    probe.step(round(SETTLE / probe.time_step))
    loaded = squeeze()
    for part in (0.8, 0.6, 0.4, 0.2):
        probe.load(0.0, 0.0, part * push * depth)
        probe.step(round(0.004 / probe.time_step))
    probe.load(0.0, 0.0, 0.0)
    probe.step(round(0.024 / probe.time_step))
    return squeeze() / loaded


def measured_wedging_tilt(scenario: Scenario, friction: float) -> tuple[float, Array]:
    """Smallest tilt at which a squeezed peg stays squeezed, and the (tilt, kept part) of every trial (n, 2).

    The tilt is NaN where no change from slipping to holding lies between the tilts that the bore allows.
    """
    sizes = PegTheory.of(scenario)
    stiff = converged(scenario, friction)
    stiff.contact.modulus = 1e11
    probe = ContactProbe(stiff, mass=0.15, inertia=3e-5, damping=(0.0, 0.0, 0.002))
    law = wedging_tilt(peg_radius=sizes.r, hole_radius=sizes.R, friction=friction)
    # Two-point contact must begin above the floor of the bore, and at a tilt that still enters.
    deepest = 0.95 * (scenario.geometry.hole_depth - scenario.geometry.chamfer)
    shallowest = two_point_tilt(deepest, peg_radius=sizes.r, hole_radius=sizes.R)
    free, wedged = max(0.7 * law, shallowest), min(1.6 * law, 0.9 * float(np.arccos(sizes.r / sizes.R)))
    if not free < wedged:
        return float("nan"), np.empty((0, 2))
    trials = [(t, squeeze_kept(probe, sizes, t)) for t in (free, wedged)]
    if trials[0][1] >= KEPT or trials[1][1] < KEPT:
        return float("nan"), np.array(trials)
    while wedged - free > 0.005 * law:
        middle = 0.5 * (free + wedged)
        trials.append((middle, squeeze_kept(probe, sizes, middle)))
        free, wedged = (free, middle) if trials[-1][1] >= KEPT else (middle, wedged)
    return 0.5 * (free + wedged), np.array(sorted(trials))
