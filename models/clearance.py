"""Numerics and start of a scenario that follow its clearance C = R - r.

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
from dataclasses import replace
from pathlib import Path

from models.contact_checks import expected_overlap, softest_modulus
from models.contact_theory import largest_entry_tilt
from models.document import read_document, read_text
from models.meshes import facet_sagitta, minimum_facets
from models.scenario import FREE_FACETS, FREE_FIXTURE, MIN_TIME_STEP, Geometry, Scenario, load_scenario
from models.validation import check_document, is_multiple

NOMINAL = Scenario()
"""The scenario whose numerics were chosen by measurement."""

SYMMETRY = 4
"""The number of facets is a multiple of this, so that both axes of the gimbal go through corners."""

TRUSTED_PART = 0.25
"""Largest overlap over the clearance under the largest load; a trial with a deeper one is not trusted."""

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


def load_scenario_of_clearance(
    name: str | Path = "nominal", engine: str | None = None, *, defaults: Scenario | None = None
) -> Scenario:
    """Reads a scenario as `load_scenario` does; its clearance decides the numerics that the file does not state.

    These are ``geometry.facets``, ``contact.modulus`` and ``contact.time_step`` (see `numerics_of_clearance`). A file
    with the nominal clearance, or with any of them, is read as it is.

    Args:
        name: of a scenario, or path of a file.
        engine: of `models.scenario.ENGINES`, in place of the scenario's; None keeps that.
        defaults: see `load_scenario`; the numerics of another clearance come before them.

    Raises:
        ValueError: see `load_scenario`.
        OSError: if the file cannot be read.
    """
    scenario = _scenario_of_clearance(name, defaults)
    scenario.contact.engine = engine or scenario.contact.engine
    return scenario


def _scenario_of_clearance(name: str | Path, defaults: Scenario | None) -> Scenario:
    path = Path(name)
    if path.suffix != ".yaml" or not path.is_file():
        return load_scenario(name, defaults=defaults)
    where = f"scenario {path}"
    document = read_document(read_text(path, where), where) or {}
    check_document(document, Scenario, where)
    geometry, contact = document.get("geometry", {}), document.get("contact", {})
    clearance = Geometry(**geometry).clearance
    stated = "facets" in geometry or {"modulus", "time_step"} & set(contact)
    if stated or not clearance > 0.0 or math.isclose(clearance, NOMINAL.geometry.clearance, rel_tol=TOLERANCE):
        if defaults is not None and document.get("fixture") == FREE_FIXTURE:
            defaults = replace(defaults, geometry=Geometry(facets=FREE_FACETS))
        return load_scenario(path, defaults=defaults)
    known = copy.deepcopy(defaults or NOMINAL)
    known.geometry, known.fixture = Geometry(**geometry), document.get("fixture", NOMINAL.fixture)
    guard = document.get("controller", {}).get("guard", {})
    known.controller.guard.force_limit = guard.get("force_limit", NOMINAL.controller.guard.force_limit)
    return load_scenario(path, defaults=numerics_of_clearance(known))


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
    return next((step for step in steps if step <= longest * (1.0 + TOLERANCE)), steps[-1])


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
