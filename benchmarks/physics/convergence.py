"""Errors of the simulated contact over its settings in Drake, and those of MuJoCo beside them.

    python -m benchmarks.physics.convergence [--mujoco] [--json FILE]

A peg with a fixed tilt of 1 degree is pushed into two-point contact, free to move sideways, until it is at rest; and a
peg slides slowly in two-point contact. Columns, one row per setting:

- play_depth_error: error of the depth at which two-point contact begins, from the meshes alone, over the
  exact h;
- depth_error: error of the depth at rest under the push, over the same h; it includes the compliance of the contact;
- moment_error: moment that keeps the tilt, relative to that of two slipping contacts;
- overlap_um, large_overlap_um: depth of overlap of the round bodies at rest, by exact geometry, under 5 N and 50 N;
- light, firm: error of the axial contact force of a peg that slides at depths of 10 and 20 mm, relative to Whitney's
  balance, with 4 mN m (light) and 0.2 N m (firm) on it; "spread" is the standard deviation of the last one;
- cost_ms: CPU time of a step in contact.

A row names what differs from the default scenario, whose bore has its corners on the true circle, like those of the
peg (as in `make_hole`), and a broken edge. The first row is the finest; the second one has the settings of earlier
scenarios (64 facets, 1e10 Pa, 1 s/m, a chamfer that begins at the mouth).

The last rows are rigid bodies in the exact engine (`systems.plant.exact_contact`), over their stiffness and step.

With --mujoco (extra [peers]) the same peg also moves in MuJoCo, where it is an exact cylinder and the bore a ring of
boxes (`benchmarks.physics.mujoco_probe`).
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer

from benchmarks.command_line import JsonFile, finish, run
from benchmarks.physics.contact_measurements import (
    CRAWLING,
    FIRM,
    LIGHT,
    PRESSED,
    PegTheory,
    crawl,
    measured_two_point_depth,
    press,
)
from benchmarks.physics.contact_probe import ContactProbe, PlanarProbe
from benchmarks.physics.exact_probe import ExactProbe
from interfaces.terminal import progress
from models.assembly import Assembly
from models.contact_theory import two_point_depth, two_point_push_moment
from models.scenario import Scenario

TILT = np.radians(1.0)
FORCE, LARGE_FORCE = 5.0, 50.0  # axial pushes, N
BEFORE = {"facets": 64, "modulus": 1e10, "dissipation": 1.0, "mouth": "sharp"}
SETTINGS: list[dict[str, Any]] = [
    {"facets": 256, "time_step": 1e-4},
    BEFORE,
    BEFORE | {"modulus": 1e11},
    {"mouth": "sharp"},
    {},
    {"dissipation": 1.0},
    *({"facets": n, "corners": "outside"} for n in (32, 64, 256)),
    *({"facets": n} for n in (24, 32, 48, 64, 128, 256)),
    *({"modulus": E} for E in (1e8, 1e9, 1e10, 2e11, 3e11, 1e12)),
    *({"time_step": dt} for dt in (4e-3, 1e-3, 5e-4, 2e-4)),
    *({"modulus": 3e11, "time_step": dt} for dt in (1e-3, 5e-4)),
    {"modulus": 3e10, "time_step": 2.5e-4},
    *({"approximation": name} for name in ("similar", "sap")),
]
"""What differs from the default scenario: facets, parameters of the contact, mouth and corners of the bore."""

SLIDES = {
    f"{name}_{1e3 * depth:.0f}mm": (moment, depth)
    for name, moment in (("light", LIGHT), ("firm", FIRM))
    for depth in (0.010, 0.020)
}


@dataclass(frozen=True)
class Case:
    """A row of the table.

    Attributes:
        name: what the row is called.
        probe: makes a probe with given mass, inertia and damping.
        scenario: with the sizes and the friction of the theory.
        bodies: the round bodies whose overlap is measured.
    """

    name: str
    probe: Callable[..., PlanarProbe]
    scenario: Scenario
    bodies: Assembly


def drake_case(setting: dict[str, Any]) -> Case:
    """The case of one of the settings."""
    scenario = Scenario()
    scenario.geometry.facets = setting.get("facets", scenario.geometry.facets)
    for name in ("modulus", "time_step", "dissipation", "approximation"):
        setattr(scenario.contact, name, setting.get(name, getattr(scenario.contact, name)))
    matched, geometry = setting.get("corners") != "outside", copy.deepcopy(scenario.geometry)
    if not matched:
        geometry.hole_radius /= np.cos(np.pi / geometry.facets)
    probe = partial(ContactProbe, scenario, matched=matched, sharp=setting.get("mouth") == "sharp")
    text = ", ".join(f"{name} {value}" for name, value in setting.items()) or "default"
    return Case(text, probe, scenario, geometry.assembly)


def exact_cases() -> Iterator[Case]:
    """Yields the cases of the exact engine: its default, then other stiffnesses and steps."""
    for stiffness, step in ((1e8, 2.5e-4), (1e7, 2.5e-4), (1e9, 2.5e-4), (1e8, 5e-4), (1e8, 1e-4)):
        scenario = Scenario()
        scenario.contact.stiffness = stiffness
        probe = partial(ExactProbe, scenario, time_step=step)
        name = f"exact, {stiffness:g} N/m, {1e3 * step:g} ms"
        yield Case(name, probe, scenario, scenario.geometry.assembly)


def mujoco_cases() -> Iterator[Case]:
    """Yields the cases of MuJoCo, in the default scenario."""
    from benchmarks.physics.mujoco_probe import MujocoContact, MujocoProbe

    scenario, rig = Scenario(), MujocoContact()
    for name, contact in (
        ("default: 0.1 ms, 1.2 ms, impedance 0.7", rig),
        ("half the step", replace(rig, time_step=0.5 * rig.time_step)),
        ("twice the step", replace(rig, time_step=2.0 * rig.time_step)),
        ("256 boxes", replace(rig, boxes=256)),
        ("impedance 0.8", replace(rig, impedance=0.8)),
        ("0.5 ms, 3 ms, impedance 0.8 (before)", replace(rig, time_step=5e-4, time_constant=3e-3, impedance=0.8)),
        ("distances to 1 um", replace(rig, precision=1e-6)),
    ):
        probe = partial(MujocoProbe, scenario, contact)
        yield Case(f"MuJoCo, {name}", probe, scenario, scenario.geometry.assembly)


def measure(case: Case) -> dict[str, float]:
    """The results of one case, by their columns; those from the meshes alone are left out in other engines."""
    sizes, friction = PegTheory.of(case.scenario), case.scenario.contact.friction
    size = {"peg_radius": sizes.r, "hole_radius": sizes.R}
    probe = case.probe(**PRESSED)
    row = {}
    if isinstance(probe, ContactProbe):
        play = measured_two_point_depth(probe, sizes, TILT)
        row["play_depth_error"] = play / float(two_point_depth(TILT, **size)) - 1.0
    row |= press(probe, sizes, case.bodies, TILT, FORCE)
    row["moment_error"] = row.pop("moment") / two_point_push_moment(FORCE, TILT, **size, friction=friction) - 1.0
    row["large_overlap_um"] = press(case.probe(**PRESSED), sizes, case.bodies, TILT, LARGE_FORCE)["overlap_um"]
    for name, (moment, depth) in SLIDES.items():
        slow = case.probe(**CRAWLING)
        predicted, measured = crawl(slow, sizes, friction, lateral=0.0, moment=moment, depth=depth)
        row[name] = float(measured.mean()) / predicted - 1.0
        row["spread"] = float(measured.std()) / predicted
    return row


def main(
    mujoco: Annotated[bool, typer.Option("--mujoco", help="Also measure MuJoCo.")] = False,
    json: JsonFile = None,
) -> None:
    cases = [*map(drake_case, SETTINGS), *exact_cases(), *(mujoco_cases() if mujoco else ())]
    rows = []
    with progress("convergence", len(cases)) as advance:
        for case in cases:
            rows.append({"setting": case.name, **measure(case)})
            advance(case.name)
    print(pd.DataFrame(rows).to_string(index=False, float_format="{:.4f}".format, na_rep="-"))
    finish({"rows": rows}, json)


if __name__ == "__main__":
    run(main)
