"""Errors of the simulated contact over the clearance, with nominal numerics, those of the rule, and finer ones.

    python -m benchmarks.physics.clearance [--clearance 0.14] [--clearance 0.038] [--points 100] [--json FILE]

The clearance c is C/r with C = R - r. The rule is `models.clearance.numerics_of_clearance`; "finer" has twice its
facets and a quarter of its step. A row names two numerics if they are equal.

The contact is compared with the theory of rigid bodies, at a friction of 0.2. Tilts are parts of the largest that
enters:

- play: largest error of the depth of two-point contact, from the meshes, at 0.3, 0.55 and 0.8 of that tilt;
- entry: error of the largest tilt that enters, from the meshes;
- mouth: median gap of the round bodies, over the clearance C, where the meshes of a tilted peg that is off the axis
  begin to touch at the mouth (200 poses);
- depth: error of the depth at rest of a peg with 0.3 of that tilt under a push of 5 N;
- overlap: depth of overlap of the round bodies there, over the clearance C, under 5 N and under 40 N;
- light, firm: error of the axial force of a peg that slides at a depth of 15 mm under 4 mN m and 0.2 N m, to the
  balance of both contacts with the tilt of the normal at the mouth (`models.contact_theory.two_point_push_moment`);
- jam: share of the loads in the jamming diagram at a depth of 20 mm, at least 5 % from its edges, that slid or stuck as
  predicted;
- wedge: error of the smallest tilt that wedges, to the exact planar condition; "-" where there is none;
- CPU: time for one second of simulated contact, s.

`benchmarks/sweeps/clearance.yaml` compares trials of the rig over the clearance.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.command_line import JsonFile, finish, run
from benchmarks.physics.contact_measurements import (
    CRAWLING,
    FIRM,
    LIGHT,
    PRESSED,
    PegTheory,
    crawl,
    jamming_trials,
    measured_entry_tilt,
    measured_two_point_depth,
    measured_wedging_tilt,
    mouth_gaps,
    press,
    unchanged,
)
from benchmarks.physics.contact_probe import ContactProbe
from interfaces.terminal import progress
from models.clearance import numerics_of_clearance
from models.contact_theory import (
    exact_wedging_tilt,
    largest_entry_tilt,
    two_point_axial_force,
    two_point_depth,
    two_point_push_moment,
    two_point_tilt,
)
from models.scenario import Scenario, dump_scenario

CLEARANCES = (0.14, 0.038, 0.014, 0.005, 0.0025)
TILTS = (0.3, 0.55, 0.8)
"""Tilts of two-point contact over the largest tilt that enters."""

PUSHES = (5.0, 40.0)  # N
SLIDE_DEPTH, JAM_DEPTH = 0.015, 0.020  # m
POSES = 200  # at the mouth
SEED = 0
"""Seed of these poses and of the loads in the jamming diagram."""


def scenario_of(clearance: float) -> Scenario:
    """The default scenario with the hole of a clearance c."""
    scenario = Scenario()
    scenario.geometry.hole_radius = scenario.geometry.peg_radius * (1.0 + clearance)
    return scenario


def finer(scenario: Scenario) -> Scenario:
    """The numerics of the rule with twice the facets and a quarter of the step."""
    scenario = numerics_of_clearance(scenario)
    scenario.geometry.facets *= 2
    scenario.contact.time_step /= 4.0
    return scenario


NUMERICS: dict[str, Callable[[Scenario], Scenario]] = {
    "nominal": copy.deepcopy,
    "rule": numerics_of_clearance,
    "finer": finer,
}


def different(choices: dict[str, Scenario]) -> Iterator[tuple[str, Scenario]]:
    """The different scenarios with their names; equal ones once, with all their names."""
    names: dict[str, list[str]] = {}
    for name, scenario in choices.items():
        names.setdefault(dump_scenario(scenario), []).append(name)
    for together in names.values():
        yield " = ".join(together), choices[together[0]]


def measure(scenario: Scenario, points: int) -> dict[str, Any]:
    """The errors of one scenario against theory; see the module.

    Args:
        scenario: its own numerics are measured.
        points: number of loads in the jamming diagram.
    """
    sizes, friction = PegTheory.of(scenario), scenario.contact.friction
    size = {"peg_radius": sizes.r, "hole_radius": sizes.R}
    largest = largest_entry_tilt(**size)
    probe = ContactProbe(scenario, **PRESSED)
    tilts = largest * np.array(TILTS)
    depths = np.array([measured_two_point_depth(probe, sizes, tilt) for tilt in tilts])
    bodies, clearance = scenario.geometry.assembly, scenario.geometry.clearance
    pressed = [press(ContactProbe(scenario, **PRESSED), sizes, bodies, tilts[0], force) for force in PUSHES]
    wedge, _ = measured_wedging_tilt(scenario, friction, numerics=unchanged)
    wedges = wedge / exact_wedging_tilt(**size, friction=friction) - 1.0
    trials = jamming_trials(scenario, friction, depth=JAM_DEPTH, count=points, seed=SEED, numerics=unchanged)
    return {
        "play": float(np.abs(depths / two_point_depth(tilts, **size) - 1.0).max()),
        "entry": measured_entry_tilt(probe, sizes) / largest - 1.0,
        "mouth": float(np.median(mouth_gaps(scenario, count=POSES, seed=SEED))) / clearance,
        "depth": pressed[0]["depth_error"],
        **{
            f"overlap_{push:.0f}n": 1e-6 * row["overlap_um"] / clearance
            for push, row in zip(PUSHES, pressed, strict=True)
        },
        "light": slide_error(scenario, LIGHT),
        "firm": slide_error(scenario, FIRM),
        "jam": trials.agreement(),
        "wedge": float(wedges) if np.isfinite(wedges) else None,
        "cpu": 1e-3 * pressed[0]["cost_ms"] / scenario.contact.time_step,
    }


def slide_error(scenario: Scenario, moment: float) -> float:
    """Error of the axial force of a peg that slides under a moment (N m), relative to the balance of both contacts."""
    sizes, friction = PegTheory.of(scenario), scenario.contact.friction
    size = {"peg_radius": sizes.r, "hole_radius": sizes.R}
    probe = ContactProbe(scenario, **CRAWLING)
    small, measured = crawl(probe, sizes, friction, lateral=0.0, moment=moment, depth=SLIDE_DEPTH)
    tilt = two_point_tilt(SLIDE_DEPTH, **size)
    exact = -moment / two_point_push_moment(1.0, tilt, **size, friction=friction)
    law = float(two_point_axial_force(0.0, moment, depth=SLIDE_DEPTH, peg_radius=sizes.r, friction=friction))
    return float(measured.mean()) / (small * exact / law) - 1.0


def text(key: str, value: float | None) -> str:
    """The text of a value in a table: errors and shares in percent, CPU time in s."""
    if value is None:
        return "-"
    if key == "cpu":
        return f"{value:.2f} s"
    return f"{100.0 * value:.2f} %" if key in ("play", "entry") else f"{100.0 * value:.1f} %"


def main(
    clearance: Annotated[list[float], typer.Option(min=1e-4, help="Value of c; repeatable.")] = list(CLEARANCES),  # noqa: B006
    points: Annotated[int, typer.Option(min=1, help="Loads in the jamming diagram.")] = 100,
    json: JsonFile = None,
) -> None:
    rows = []
    with progress("clearance", len(clearance)) as advance:
        for c in clearance:
            for names, scenario in different({name: change(scenario_of(c)) for name, change in NUMERICS.items()}):
                facets, contact = scenario.geometry.facets, scenario.contact
                found = measure(scenario, points)
                numerics = {"facets": facets, "modulus": contact.modulus, "time_step": contact.time_step}
                rows.append({"clearance": c, "numerics": names, **numerics, **found})
                values = ", ".join(f"{key} {text(key, value)}" for key, value in found.items())
                settings = f"{facets}, {contact.modulus:.3g} Pa, {1e3 * contact.time_step:.3g} ms"
                print(f"c {c:g}, {names} ({settings}): {values}", flush=True)
            advance(f"c = {c:g}")
    finish({"rows": rows}, json)


if __name__ == "__main__":
    run(main)
