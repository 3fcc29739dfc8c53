"""What of a scenario follows its geometry where a file does not state it (`following`).

**Sizes.** The rest of the nominal rig was chosen for r = 10 mm and a hole 25 mm deep.

- What must hold the part grows with it, and never shrinks: stock of the nominal size serves smaller parts. A deeper
  hole takes as much more of ``peg_length`` and ``sensor.height``, or holder and sensor would enter it. A wider one
  leaves the wall of the block. The time limits grow with the travel from the start to the bottom.
- ``start.height`` grows with r: the rim of a tilted hole, at r sin(tilt), must stay below the tip while the sensor is
  tared.
- The load is the moment over r, and a microstep changes it by (pi/2) T_h / (microsteps r). ``holding_torque``, the
  current of the driver, and ``damping`` of the steppers are proportional to r, so that this load and the time constant
  of a step stay. Otherwise a step of the nominal motor would load a peg of 3 mm with 33 N.
- The feed must hold the peg: ``current_limit`` also carries what the peg is heavier than the nominal one, and the gains
  of its speed are proportional to the mass that it moves, so that the speed settles as fast.
- Likewise the coupling to the hand: the angular stiffness and damping are proportional to r, ``torque_scale`` to 1/r,
  so that a load turns the peg as far, and feels as large. The guide of the fixture has the lever l = depth + pivot;
  ``peg_inertia`` follows the damping 2 B + B_g l^2 about the tip, so that B dt/I keeps its margin
  (`systems.haptics.coupling_margins`).
- A tilted peg that enters a narrow hole at the speed v must turn at about v/r, which takes the impulse I v / r^2. The
  operator's ``insertion_speed`` is lower where this would be more than nominal.
- A loose peg may reach the floor with the tilt theta of two-point contact, or of its start if that is smaller; its rim
  then touches at r sin(theta). This and 0.1 mm are the ``full_depth_margin``, where that is more than the nominal one.
- The ranges of the tilt keep their part of the largest tilt that enters (`start_of_clearance`).

Hardware stays: sensor, feed, mount, pivot, force limits; so do the other habits of people, and the chamfer, which must
take the offset of a tip that turns about the pivot, whatever its radius.

**Numerics** follow the clearance C = R - r. The exact engine keeps the nominal step: its bodies are rigid, and it
solves for the gap at the end of a step, so that no overlap is proportional to the step.

The numerics of the nominal scenario, with C = 50 um and c = C/r = 0.005, were chosen by measurement (docs/physics.md,
"Convergence"). A simulation adds three lengths to those of the bodies. The contact at another clearance is as good as
the nominal one if each length keeps its ratio to the clearance:

- The sagitta of the polygons, s = R (1 - cos(pi/n)), about R pi^2 / (2 n^2). A peg on the axis of the bore has the play
  of aligned polygons, which is wrong by the part s/R at any clearance. But the rim of a tilted peg crosses the mouth
  while the centre of its tip is off the axis, by up to e = sqrt(R^2 - r^2), about r sqrt(2c): the distance between the
  axis and a diameter of the peg that is a chord of the mouth. The corners are then apart by the angle e/R, and a corner
  that is turned by a small angle a comes nearer to a side by R a tan(pi/n). The error over the clearance is up to about
  sqrt(2/c) pi/n. It is constant if n is proportional to 1/sqrt(c), as is s/C.
- The distance v dt that the peg moves in a step. Bodies that do not yet touch exert no force, so that the first overlap
  is up to v dt. The speed v is that of the feed, which does not depend on the clearance: dt is proportional to C.
- The overlap of the compressed bodies, delta = k r (F / (E r^2))^m (`models.contact_checks`), under the largest load F
  that the force guard permits. With m = 0.4 the modulus E is proportional to F C^-2.5.

Three other quantities bound the modulus:

- Drake extrapolates the pressure over a step, by about E v dt / r (`models.meshes.BrokenEdge`). Where the area of
  contact does not depend on C, as along a line, this is a force that grows with E dt and adds to friction and impacts.
  E dt is at most the nominal one. Below the nominal clearance this leaves E proportional to 1/C, and delta/C to C^-0.6.
- Trials are trusted up to an overlap of a quarter of the clearance. delta must be smaller under the load F. With the
  nominal peg this counts below c = 0.0008.
- The deflection F/K of the mount, with the stiffness K. The contact must add little to it. This counts above c = 0.024.

A larger clearance would permit fewer facets and a longer step. They stay nominal, because other limits are near: 24
facets are worse in a slow slide, and the haptic coupling is not stable with a step of 4 ms (docs/physics.md).
"""

from __future__ import annotations

import copy
import math

from models.contact_checks import expected_overlap, softest_modulus
from models.contact_theory import largest_entry_tilt, two_point_tilt
from models.hardware import GRAVITY, STEEL
from models.meshes import facet_sagitta, minimum_facets
from models.scenario_tree import FREE_FACETS, FREE_FIXTURE, MIN_TIME_STEP, Geometry, Scenario
from models.validation import copied, is_multiple, leaves

NOMINAL = Scenario()
"""The scenario whose numerics were chosen by measurement."""

SYMMETRY = 4
"""The number of facets is a multiple of this, so that both axes of the gimbal go through corners."""

TRUSTED_PART = 0.25
"""Largest overlap over the clearance under the largest load; a trial with a deeper one is not trusted."""

CORNER = 2.0
"""At least how far the corners of a named section are from the axis, over its sides."""

MARGIN = 0.1e-3
"""Distance above the seat of a tilted peg that counts as inserted, m."""

MOUNT_PART = 0.1
"""Largest overlap over the deflection of the nominal mount, both under the largest load."""

TOLERANCE = 1e-9
"""Relative difference of two lengths or times that counts as rounding."""


def numerics_of_clearance(scenario: Scenario) -> Scenario:
    """Returns a copy of a valid scenario with the facets, the modulus and the time step that its clearance requires.

    The copy is valid. The nominal scenario is returned unchanged. At a clearance above the nominal one facets and step
    are the nominal ones.

    Args:
        scenario: Scenario whose geometry, fixture, periods and force limit count; not modified.
    """
    chosen = copy.deepcopy(scenario)
    g = chosen.geometry
    g.facets = facets_of_clearance(
        hole_radius=g.hole_radius, clearance=g.clearance, spins=scenario.fixture == FREE_FIXTURE
    )
    chosen.contact.modulus = modulus_of_clearance(
        clearance=g.clearance, peg_radius=g.peg_radius, load=scenario.controller.guard.force_limit
    )
    chosen.contact.time_step = _common_step(
        scenario.controller.period, scenario.recorder.period, longest=step_of_clearance(g.clearance)
    )
    return chosen


FOLLOWERS = (
    *("geometry.facets", "contact.modulus", "contact.time_step"),
    *("geometry.peg_length", "geometry.block_radius", "sensor.height", "start.height"),
    *("start.tilt_range", "start.demonstrated_tilt_range", "trial.full_depth_margin"),
    *("recorder.time_limit", "trial.time_limit"),
    *("stepper.holding_torque", "stepper.damping", "coupling.angular_stiffness", "coupling.angular_damping"),
    *("coupling.torque_scale", "coupling.peg_inertia", "operator.insertion_speed"),
    *("feed.current_limit", "feed.speed_kp", "feed.speed_ki"),
)
"""Keys of a scenario that follow its geometry."""


def following(scenario: Scenario, base: Scenario = NOMINAL) -> Scenario:
    """Returns a copy in which the `FOLLOWERS` are those of the geometry, and those of the base at its geometry.

    Args:
        scenario: Scenario whose numbers are within their limits, and whose clearance can be resolved; not modified.
        base: Valid scenario; what follows other sizes than its own, follows from its values.
    """
    chosen: Scenario = copied(scenario)
    g, own = scenario.geometry, base.geometry
    for path in FOLLOWERS:
        group, name = path.split(".")
        setattr(getattr(chosen, group), name, getattr(getattr(base, group), name))
    if math.isclose(g.clearance, own.clearance, rel_tol=TOLERANCE):
        chosen.geometry.facets = max(own.facets, FREE_FACETS if scenario.fixture == FREE_FIXTURE else 0)
    else:
        chosen = numerics_of_clearance(chosen)
    if scenario.contact.engine == "exact" or step_of_clearance(g.clearance) == NOMINAL.contact.time_step:
        chosen.contact.time_step = base.contact.time_step
    if relative_entry_tilt(scenario) != relative_entry_tilt(base):
        chosen = start_of_clearance(chosen)
    deeper, size = max(0.0, g.hole_depth - own.hole_depth), _radius(g) / _radius(own)
    chosen.geometry.peg_length += deeper
    chosen.sensor.height += deeper
    chosen.geometry.block_radius += (1.0 if g.is_round else CORNER) * max(0.0, g.hole_radius - own.hole_radius)
    chosen.start.height *= max(1.0, size)
    travel = (chosen.start.height + g.hole_depth) / (base.start.height + own.hole_depth)
    for limited in (chosen.recorder, chosen.trial):
        limited.time_limit *= max(1.0, travel)
    chosen.stepper.holding_torque *= size
    chosen.stepper.damping *= size
    own_mass, more = _peg_mass(base.geometry), _peg_mass(chosen.geometry) - _peg_mass(base.geometry)
    chosen.feed.current_limit += max(0.0, more) * GRAVITY / chosen.feed.force_constant
    for gain in ("speed_kp", "speed_ki"):
        gains = 1.0 + max(0.0, more) / (own_mass + chosen.feed.reflected_mass)
        setattr(chosen.feed, gain, getattr(chosen.feed, gain) * gains)
    chosen.coupling.angular_stiffness *= size
    chosen.coupling.angular_damping *= size
    chosen.coupling.torque_scale /= size
    heavier = _guided_damping(chosen) / _guided_damping(base)
    chosen.coupling.peg_inertia *= heavier
    chosen.operator.insertion_speed *= min(1.0, size**2 / heavier)
    chosen.trial.full_depth_margin = max(chosen.trial.full_depth_margin, seating_error(scenario) + MARGIN)
    return chosen


def _radius(g: Geometry) -> float:
    """Returns the radius that loads act on, m: of mates, whose circles may be off the axis, the reach."""
    return g.reach if g.mates else g.peg_radius


def _peg_mass(g: Geometry) -> float:
    """Returns the mass of a round peg of steel, kg."""
    return STEEL * math.pi * g.peg_radius**2 * g.peg_length


def _guided_damping(scenario: Scenario) -> float:
    """Returns the damping of coupling and guide about the tip of a peg at the bottom, N m s/rad."""
    lever, coupling = scenario.geometry.hole_depth + NOMINAL.rig.pivot_range, scenario.coupling
    return 2.0 * coupling.angular_damping + coupling.guide_damping * lever**2


def seating_error(scenario: Scenario) -> float:
    """Returns how far above the floor the tip of a tilted peg rests (m): r sin of the largest tilt that it may have.

    That is the tilt of two-point contact at the bottom, or of the start if that is smaller.
    """
    g = scenario.geometry
    play = two_point_tilt(g.hole_depth, peg_radius=g.peg_radius, hole_radius=g.hole_radius)
    return _radius(g) * math.sin(min(play, largest_start_tilt(scenario)))


def largest_start_tilt(scenario: Scenario) -> float:
    """Returns the largest tilt of a demonstration's start, about both axes together, rad."""
    return math.sqrt(2.0) * scenario.start.demonstrated_tilt_range


def followed(scenario: Scenario, base: Scenario = NOMINAL) -> str:
    """Returns the keys that follow the geometry, with values in SI units, where these are not those of the base."""
    own, given, rule = ({path: v for path, v, _ in leaves(s)} for s in (scenario, base, following(scenario, base)))
    return ", ".join(f"{path} {own[path]:.3g}" for path in FOLLOWERS if own[path] == rule[path] != given[path])


def facets_of_clearance(*, hole_radius: float, clearance: float, spins: bool) -> int:
    """Returns the number of facets whose sagitta is at most the nominal part of the clearance.

    Args:
        hole_radius: R, m.
        clearance: R - r, m.
        spins: Whether the peg may rotate about its axis. Then a quarter of the clearance is the bound (see
            `models.meshes.minimum_facets`).
    """
    g = NOMINAL.geometry
    if spins:
        fewest, needed = FREE_FACETS, float(minimum_facets(hole_radius, clearance))
    else:
        part = facet_sagitta(g.hole_radius, g.facets) / g.clearance
        fewest, needed = g.facets, math.pi / math.acos(1.0 - part * clearance / hole_radius)
    return max(fewest, SYMMETRY * math.ceil(needed * (1.0 - TOLERANCE) / SYMMETRY))


def modulus_of_clearance(*, clearance: float, peg_radius: float, load: float) -> float:
    """Returns the modulus (Pa), to three significant digits.

    The overlap under the load is the nominal part of the clearance, if that needs no larger product of modulus and step
    than the nominal one. It is at most `TRUSTED_PART` of the clearance, and `MOUNT_PART` of the deflection of the
    nominal mount under that load.

    Args:
        clearance: R - r, m.
        peg_radius: r, m.
        load: Largest load of the contact, N; below the nominal force limit of the controller, that limit counts.
    """
    g, contact, limit = NOMINAL.geometry, NOMINAL.contact, NOMINAL.controller.guard.force_limit
    largest = max(load, limit)

    def softest(overlap: float) -> float:
        return softest_modulus(clearance=overlap, peg_radius=peg_radius, load=largest)

    part = expected_overlap(modulus=contact.modulus, peg_radius=g.peg_radius, load=limit) / g.clearance
    stiffest = contact.modulus * contact.time_step / step_of_clearance(clearance)
    needed = min(softest(part * clearance), stiffest)
    allowed = min(TRUSTED_PART * clearance, MOUNT_PART * largest / NOMINAL.rig.mount_stiffness)
    return float(f"{max(needed, softest(allowed)):.3g}")


def step_of_clearance(clearance: float) -> float:
    """Returns the longest time step (s) in which the peg moves by at most the nominal part of the clearance (m)."""
    return max(MIN_TIME_STEP, NOMINAL.contact.time_step * min(1.0, clearance / NOMINAL.geometry.clearance))


def _common_step(first: float, second: float, *, longest: float) -> float:
    """Returns the longest step, up to ``longest``, of which both periods are multiples (all in s).

    If there is none within the limits of a scenario, it is the shortest step within them.
    """
    shortest = MIN_TIME_STEP
    counts = range(1, math.floor(first / shortest * (1.0 + TOLERANCE)) + 1)
    steps = [max(shortest, first / count) for count in counts if is_multiple(second, first / count)]
    return next((step for step in steps if step <= longest * (1.0 + TOLERANCE)), steps[-1] if steps else longest)


def start_of_clearance(scenario: Scenario) -> Scenario:
    """Returns a copy whose ranges of the initial tilt are at most the nominal part of the largest tilt that enters.

    This changes the task, not the numerics. The largest tilt at which the tip passes the mouth, arccos(r/R), is about
    sqrt(2c). The nominal ranges are 0.59 of it in a trial and 0.70 in a demonstration, on each axis, so that a peg that
    is tilted about both axes of a trial has at most 0.84 of it. Ranges that are smaller stay: at a larger clearance the
    turns of the controller and the demonstrated tilts are limited.

    Args:
        scenario: Scenario whose geometry counts; not modified. A given tilt stays.
    """
    chosen = copy.deepcopy(scenario)
    nominal, start, part = NOMINAL.start, chosen.start, relative_entry_tilt(chosen)
    start.tilt_range = min(start.tilt_range, part * nominal.tilt_range)
    start.demonstrated_tilt_range = min(start.demonstrated_tilt_range, part * nominal.demonstrated_tilt_range)
    return chosen


def relative_entry_tilt(scenario: Scenario) -> float:
    """Returns the largest tilt at which the tip passes the mouth, over that of the nominal scenario."""
    own, nominal = (
        largest_entry_tilt(peg_radius=g.peg_radius, hole_radius=g.hole_radius)
        for g in (scenario.geometry, NOMINAL.geometry)
    )
    return own / nominal


TRIED = {"peg_radius (m)": (0.003, 0.030), "C/r": (0.002, 0.2), "hole_depth/r": (0.5, 5.0)}
"""Sizes of the pegs of docs/own_pegs.csv."""


SMALL = 0.006
"""Radius of a round peg below which skills of docs/own_pegs.csv may miss two or more of ten trials, m."""


def doubts(scenario: Scenario) -> list[str]:
    """Returns why the skill may not insert this part, in words; nothing where no reason is known."""
    g = scenario.geometry
    found = []
    sizes = (g.peg_radius, g.clearance / g.peg_radius, g.hole_depth / g.peg_radius)
    for (name, (least, most)), value in zip(TRIED.items(), sizes, strict=True):
        if not least * (1.0 - TOLERANCE) <= value <= most * (1.0 + TOLERANCE):
            found.append(f"{name} {value:.3g} was not tried, {least:g} to {most:g} were")
    if g.is_round and g.peg_radius < SMALL:
        found.append(
            f"its radius is {1e3 * g.peg_radius:.3g} mm; below {1e3 * SMALL:g} mm a third of the skills missed two to"
            " four of ten trials"
        )
    offset = scenario.rig.demonstrated_pivot_range * math.sin(largest_start_tilt(scenario))
    if g.chamfer + g.clearance < offset:
        found.append(
            f"its tip starts up to {1e3 * offset:.2g} mm off the axis, chamfer and clearance take"
            f" {1e3 * (g.chamfer + g.clearance):.2g} mm"
        )
    return found
