"""Two-point contact in Drake and in MuJoCo: error relative to rigid bodies, and cost of a step.

    python -m benchmarks.physics.engines [--json FILE]       needs the extra [peers]

Both engines move the same peg with the same planar freedoms. Columns, one row per engine and setting; the first three
are from a press, the next three from slow slides:

- depth, overlap um, moment: a peg with a fixed tilt of 1 degree is pushed with 5 N until it rests on two points (see
  `benchmarks.physics.convergence`): error of its depth relative to the exact h, overlap of the round bodies, and error
  of the moment of the contacts relative to that of two slipping contacts;
- light crawl, firm crawl: the peg slides slowly at a depth of 20 mm under a moment that presses each contact with
  0.2 N or 10 N: error of the axial contact force relative to Whitney's balance; "its spread" is the standard deviation
  of the force in the firm crawl, relative to the same balance;
- ms a step: CPU time of a step in contact.

In MuJoCo the peg is an exact cylinder and the bore a ring of boxes (`systems.plant.mujoco_model`).
`benchmarks.rig.mujoco` compares the engines in trials of the rig.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml", "mujoco")

import numpy as np

from benchmarks.command_line import argument_parser, run
from benchmarks.physics.contact_measurements import CRAWLING, PegTheory, converged, crawl
from benchmarks.physics.contact_probe import ContactProbe, PlanarProbe
from benchmarks.physics.convergence import FINEST, MOMENTS, PRESSED, press
from benchmarks.physics.mujoco_probe import MujocoProbe
from experiments.metrics.penetration import round_bodies
from interfaces.terminal import progress, write_json
from models.contact_theory import two_point_push_moment
from models.scenario import Scenario
from systems.plant.mujoco_model import MujocoContact

TILT, PUSH = np.radians(1.0), 5.0  # rad, N
CRAWL_DEPTH = 0.020  # m


def measure(make: Callable[..., PlanarProbe], scenario: Scenario) -> dict[str, float]:
    """The results of one engine and setting; ``make`` returns a probe with given mass, inertia and damping."""
    friction, sizes = scenario.contact.friction, PegTheory.of(scenario)
    bodies = round_bodies(scenario.geometry)
    row = press(make(**PRESSED), sizes, bodies, TILT, PUSH)
    slipping = two_point_push_moment(PUSH, TILT, peg_radius=sizes.r, hole_radius=sizes.R, friction=friction)
    row["moment_error"] = row.pop("moment") / slipping - 1.0
    for name, moment in MOMENTS.items():
        probe = make(**CRAWLING)
        predicted, measured = crawl(probe, sizes, friction, lateral=0.0, moment=moment, depth=CRAWL_DEPTH)
        row[f"{name}_error"] = float(measured.mean()) / predicted - 1.0
        row[f"{name}_spread"] = float(measured.std()) / predicted
    return row


def settings() -> Iterator[tuple[str, Callable[..., PlanarProbe], Scenario]]:
    """Yields the name, the constructor of probes, and the scenario of every row."""
    default = Scenario()
    finest = copy.deepcopy(default)
    finest.geometry.facets, finest.contact.time_step = int(FINEST["facets"]), FINEST["time_step"]
    for name, scenario in (
        ("default", default),
        ("finest", finest),
        ("softer, shorter steps", converged(default, default.contact.friction)),
    ):
        c = scenario.contact
        text = f"Drake, {name}: n = {scenario.geometry.facets}, {c.modulus:.0e} Pa, {1e3 * c.time_step:g} ms"

        def drake(scenario: Scenario = scenario, **freedoms: Any) -> ContactProbe:
            return ContactProbe(scenario, **freedoms)

        yield text, drake, scenario
    rig = MujocoContact()
    hard = replace(rig, time_constant=2.0, impedance=(0.95, 0.99, 1e-4))
    for name, contact in (
        ("the rig's", rig),
        ("twice the step", replace(rig, time_step=2.0 * rig.time_step)),
        ("256 boxes", replace(rig, boxes=256)),
        ("hard", hard),
        ("hard, distances to 1 um", replace(hard, precision=1e-6)),
    ):

        def mujoco(contact: MujocoContact = contact, **freedoms: Any) -> MujocoProbe:
            return MujocoProbe(default, contact, **freedoms)

        yield f"MuJoCo, {name}: {contact.boxes} boxes, {1e3 * contact.time_step:g} ms", mujoco, default


def main() -> None:
    arguments = argument_parser(__doc__).parse_args()
    rows: dict[str, dict[str, float]] = {}
    columns = {
        "depth_error": "depth",
        "overlap_um": "overlap um",
        "moment_error": "moment",
        "light_error": "light crawl",
        "firm_error": "firm crawl",
        "firm_spread": "its spread",
        "cost_ms": "ms a step",
    }
    print(f"{'':52}" + "".join(f"{title:>13}" for title in columns.values()))
    chosen = list(settings())
    with progress("engines", len(chosen)) as advance:
        for name, make, scenario in chosen:
            row = rows[name] = measure(make, scenario)
            print(f"{name:52}" + "".join(f"{cell(key, row[key]):>13}" for key in columns), flush=True)
            advance(name)
    if arguments.json:
        write_json(arguments.json, rows)


def cell(key: str, value: float) -> str:
    """The text of a value in the table."""
    if key == "cost_ms":
        return f"{value:.3f}"
    return f"{value:.1f}" if key == "overlap_um" else f"{100 * value:.1f} %"


if __name__ == "__main__":
    run(main)
