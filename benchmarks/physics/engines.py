"""Two-point contact in Drake and in MuJoCo: how near to rigid bodies, and at what cost of a step.

    python -m benchmarks.physics.engines [--json FILE]       needs the extra [peers]

Both engines move the same peg with the same planar freedoms through the same cases:

- press: a peg whose tilt is held at 1 degree is pushed with 5 N until it rests on two points (case of
  `benchmarks.physics.convergence`): its depth against the exact h(theta), how deep the round bodies overlap, and the
  moment
  that the contacts need to carry the push, against that of both contacts slipping;
- light and firm crawl: 20 mm deep, the peg slides slowly under a moment that presses each contact with 0.2 and with
  10 N; the axial contact force against Whitney's balance, and for the firm crawl its standard deviation.

In MuJoCo the peg is an exact cylinder and the bore a ring of boxes (`benchmarks.physics.mujoco_model`). The rig and
its trials
in both engines are in `benchmarks.rig.mujoco`.
"""

from __future__ import annotations

import argparse
import copy
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.physics.contact_measurements import CRAWLING, PegTheory, PlanarProbe, converged, crawl
from benchmarks.physics.contact_probe import ContactProbe
from benchmarks.physics.convergence import FINEST, press
from benchmarks.physics.mujoco_model import MujocoContact, MujocoProbe
from models.contact_theory import two_point_push_moment
from models.scenario import Scenario
from systems.runs.penetration import round_bodies

TILT, PUSH = np.radians(1.0), 5.0  # rad, N
CRAWL_DEPTH, CRAWL_MOMENTS = 0.020, {"light": 4e-3, "firm": 0.2}  # m, N m
PRESSED: dict[str, Any] = {"mass": 0.5, "damping": (5.0, 40.0, 0.0)}


def measure(make: Callable[..., PlanarProbe], scenario: Scenario) -> dict[str, float]:
    """All cases with one engine and one setting."""
    friction, sizes = scenario.contact.friction, PegTheory.of(scenario)
    bodies = round_bodies(scenario.geometry)
    row = press(make(**PRESSED), sizes, bodies, TILT, PUSH)
    slipping = two_point_push_moment(PUSH, TILT, peg_radius=sizes.r, hole_radius=sizes.R, friction=friction)
    row["moment_error"] = row.pop("moment") / slipping - 1.0
    for name, moment in CRAWL_MOMENTS.items():
        probe = make(**CRAWLING)
        predicted, measured = crawl(probe, sizes, friction, lateral=0.0, moment=moment, depth=CRAWL_DEPTH)
        row[f"{name}_error"] = float(measured.mean()) / predicted - 1.0
        row[f"{name}_spread"] = float(measured.std()) / predicted
    return row


def settings() -> Iterator[tuple[str, Callable[..., PlanarProbe], Scenario]]:
    """Name, maker of probes, and scenario of every row."""
    default = Scenario()
    finest = copy.deepcopy(default)
    finest.geometry.facets, finest.contact.time_step = FINEST["facets"], FINEST["time_step"]
    for name, scenario in (
        ("default", default),
        ("finest", finest),
        ("nearest to rigid", converged(default, default.contact.friction)),
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
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
    for name, make, scenario in settings():
        row = rows[name] = measure(make, scenario)
        cells = [
            f"{row[key]:.3f}" if key == "cost_ms" else f"{row[key]:.1f}" if "um" in key else f"{100 * row[key]:.1f} %"
            for key in columns
        ]
        print(f"{name:52}" + "".join(f"{cell:>13}" for cell in cells), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
