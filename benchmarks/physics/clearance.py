"""Errors of the simulated contact over the clearance, with nominal numerics, those of the rule, and finer ones.

    python -m benchmarks.physics.clearance [--clearances 0.14,0.038,0.014,0.005,0.0025] [--points 100] [--json FILE]
    python -m benchmarks.physics.clearance --skill FILE [--first 84900] [--trials 10] [--jobs 1] [--json FILE]

The clearance c is C/r with C = R - r. The rule is `models.clearance.numerics_of_clearance`; "finer" has twice its
facets and a quarter of its step. A row names two numerics if they are equal.

Without --skill the contact is compared with the theory of rigid bodies, at a friction of 0.2. Tilts are parts of the
largest that enters:

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

With --skill that skill performs trials of the rig at every clearance, with the default range of the initial tilt and
with that of `models.clearance.start_of_clearance`. It remains the skill of its own clearance: only the geometry in its
metadata is replaced. Trusted are trials whose bodies overlap by at most a quarter of the clearance. Loads are the
largest of a trial: the true one at any step, which grows as the step is shortened, because an impact lasts a step at
least; and the measured one, which the low-pass of the sensor makes comparable.
"""

from __future__ import annotations

import argparse
import copy
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

import numpy as np

from benchmarks.command_line import argument_parser, run
from benchmarks.physics.contact_measurements import (
    CRAWLING,
    PegTheory,
    crawl,
    jamming_trials,
    measured_entry_tilt,
    measured_two_point_depth,
    measured_wedging_tilt,
    mouth_gaps,
    unchanged,
)
from benchmarks.physics.contact_probe import ContactProbe
from benchmarks.physics.convergence import MOMENTS, PRESSED, press
from experiments.metrics.penetration import round_bodies
from experiments.trial import run_trials
from interfaces.terminal import progress, write_json
from models.clearance import numerics_of_clearance, start_of_clearance
from models.contact_theory import (
    exact_wedging_tilt,
    largest_entry_tilt,
    two_point_axial_force,
    two_point_depth,
    two_point_push_moment,
    two_point_tilt,
)
from models.scenario import Scenario, dump_scenario
from skill.manipulation_skill import ManipulationSkill

CLEARANCES = (0.14, 0.038, 0.014, 0.005, 0.0025)
TILTS = (0.3, 0.55, 0.8)
"""Tilts of two-point contact over the largest tilt that enters."""

PUSHES = (5.0, 40.0)  # N
SLIDE_DEPTH, JAM_DEPTH = 0.015, 0.020  # m
POSES = 200  # at the mouth
SEED = 0
"""Seed of these poses and of the loads in the jamming diagram."""


def clearances(text: str) -> list[float]:
    """Reads positive clearances, separated by commas."""
    values = [float(part) for part in text.split(",")]
    if not values or min(values) <= 0.0:
        raise argparse.ArgumentTypeError(f"{text}: expected positive clearances, separated by commas")
    return values


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
STARTS: dict[str, Callable[[Scenario], Scenario]] = {"default": copy.deepcopy, "rule": start_of_clearance}


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
    bodies, clearance = round_bodies(scenario.geometry), scenario.geometry.clearance
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
        **{name: slide_error(scenario, moment) for name, moment in MOMENTS.items()},
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


def perform(scenario: Scenario, skill: ManipulationSkill, numbers: list[int], jobs: int) -> dict[str, Any]:
    """Performs trials and summarises them.

    Args:
        scenario: with ranges.
        skill: of any clearance; the geometry in its metadata is replaced.
        numbers: of the trials.
        jobs: number of processes; the CPU time is that of this process and tells something with one only.
    """
    here = copy.copy(skill)
    here.metadata_ = {**skill.metadata_, "geometry": asdict(scenario.geometry)}
    begun = time.process_time()
    results = [result for result, _ in run_trials(scenario, here, numbers, jobs=jobs)]
    cpu = time.process_time() - begun
    loads = [result.peak_load for result in results if result.peak_load is not None]
    measured = [result.peak_measured_load for result in results if result.peak_measured_load is not None]
    return {
        "trials": len(results),
        "inserted": sum(result.inserted for result in results),
        "trusted": sum(bool(result.trusted) for result in results),
        "median_load": float(np.median(loads)),
        "largest_load": max(loads),
        "median_measured_load": float(np.median(measured)),
        "largest_measured_load": max(measured),
        "largest_overlap": max(result.penetration for result in results) / scenario.geometry.clearance,
        "cpu": cpu / sum(result.time for result in results),
    }


def text(key: str, value: float | None) -> str:
    """The text of a value in a table: errors and shares in percent, loads in N, CPU time in s."""
    if value is None:
        return "-"
    if key in ("trials", "inserted", "trusted"):
        return f"{value:.0f}"
    if key.endswith("load"):
        return f"{value:.1f} N"
    if key == "cpu":
        return f"{value:.2f} s"
    return f"{100.0 * value:.2f} %" if key in ("play", "entry") else f"{100.0 * value:.1f} %"


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--clearances", type=clearances, default=list(CLEARANCES), help="values of c")
    parser.add_argument("--points", type=int, default=100, help="loads in the jamming diagram (default: 100)")
    parser.add_argument("--skill", type=Path, metavar="FILE", help="skill that performs trials")
    parser.add_argument("--first", type=int, default=84900, help="number of the first trial (default: 84900)")
    parser.add_argument("--trials", type=int, default=10, help="trials of each row (default: 10)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    arguments = parser.parse_args()
    skill = None if arguments.skill is None else ManipulationSkill.load(arguments.skill)
    numbers = list(range(arguments.first, arguments.first + arguments.trials))
    rows: list[dict[str, Any]] = []
    with progress("clearance", len(arguments.clearances)) as advance:
        for clearance in arguments.clearances:
            bare = scenario_of(clearance)
            if skill is None:
                choices = {name: change(bare) for name, change in NUMERICS.items()}
            else:
                choices = {
                    f"{name}, start {start}": begin(NUMERICS[name](bare))
                    for name in ("nominal", "rule")
                    for start, begin in STARTS.items()
                }
            for names, scenario in different(choices):
                row = {
                    "clearance": clearance,
                    "numerics": names,
                    "facets": scenario.geometry.facets,
                    "modulus": scenario.contact.modulus,
                    "time_step": scenario.contact.time_step,
                }
                found = (
                    measure(scenario, arguments.points)
                    if skill is None
                    else perform(scenario, skill, numbers, arguments.jobs)
                )
                rows.append(row | found)
                numerics = f"{row['facets']}, {row['modulus']:.3g} Pa, {1e3 * scenario.contact.time_step:.3g} ms"
                values = ", ".join(f"{key} {text(key, value)}" for key, value in found.items())
                print(f"c {clearance:g}, {names} ({numerics}): {values}", flush=True)
            advance(f"c = {clearance:g}")
    if arguments.json:
        write_json(arguments.json, rows)


if __name__ == "__main__":
    run(main)
