"""Errors of the simulated contact over number of facets, modulus, time step and contact approximation.

    python -m benchmarks.physics.convergence [--tilt-deg 1] [--force 5] [--large-force 50] [--json FILE]

A peg with a fixed tilt is pushed into two-point contact, free to move sideways, until it is at rest; and a peg slides
slowly in two-point contact. Columns, one row per setting:

- play depth: error of the depth at which two-point contact begins, from the meshes alone, relative to the exact h;
- depth: error of the depth at rest under the push, relative to the same h; it includes the compliance of the contact;
- moment: moment that keeps the tilt, relative to that of two slipping contacts;
- overlap: depth of overlap of the round bodies at rest, by exact geometry, um, under --force and under --large-force;
- light, firm: error of the axial contact force of a peg that slides at depths of 10 and 20 mm, relative to Whitney's
  balance, with 4 mN m (light) and 0.2 N m (firm) on it;
- ms a step: CPU time of a step in contact.

"finest" has 256 facets and steps of 0.1 ms; "before" are the settings of earlier scenarios (64 facets, 1e10 Pa,
1 s/m, a chamfer that begins at the mouth).

"corners" says where the corners of the bore's polygon lie: on the true circle, like those of the peg (as in
`make_bore`), or outside it.
"""

from __future__ import annotations

import copy
import time
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

import numpy as np

from benchmarks.command_line import argument_parser, run
from benchmarks.physics.contact_measurements import CRAWLING, PegTheory, crawl, measured_two_point_depth
from benchmarks.physics.contact_probe import ContactProbe, PlanarPose, PlanarProbe
from interfaces.terminal import progress, write_json
from models.contact_geometry import PegInHole, axes_of_rotation_vectors
from models.contact_theory import two_point_depth, two_point_push_moment
from models.scenario import Scenario

REST = 0.08  # s; simulated time until the peg is at rest
PRESSED: dict[str, Any] = {"mass": 0.5, "damping": (5.0, 40.0, 0.0)}
"""A probe that comes to rest under a push."""
MOMENTS, DEPTHS = {"light": 4e-3, "firm": 0.2}, (0.010, 0.020)  # N m, m; of the slow slides
TIMED = 0.02  # s; simulated time at rest over which the cost of a step is averaged

FINEST = {"facets": 256, "time_step": 1e-4}
BEFORE = {"facets": 64, "modulus": 1e10, "dissipation": 1.0, "mouth": "sharp"}
SETTINGS: list[dict[str, Any]] = [
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
    *({"approximation": name} for name in ("similar", "sap")),
]
"""What differs from the default scenario, whose bore has its corners on the circle and a broken edge."""

SLIDES = {f"{name}_{1e3 * depth:.0f}mm": (moment, depth) for name, moment in MOMENTS.items() for depth in DEPTHS}


def scenario_of(setting: dict[str, Any]) -> Scenario:
    """The default scenario with ``facets`` and parameters of the contact replaced, where the setting names them."""
    scenario = copy.deepcopy(Scenario())
    scenario.geometry.facets = setting.get("facets", scenario.geometry.facets)
    for name in ("modulus", "time_step", "dissipation", "approximation"):
        setattr(scenario.contact, name, setting.get(name, getattr(scenario.contact, name)))
    return scenario


def measure(setting: dict[str, Any], tilt: float, force: float, large_force: float) -> dict[str, Any]:
    """The results of one setting.

    Args:
        setting: as in `scenario_of`, or ``corners`` or ``mouth``; the others are default.
        tilt: of the peg, rad.
        force: axial push, N.
        large_force: axial push for the second overlap, N.
    """
    scenario = scenario_of(setting)
    matched = setting.get("corners") != "outside"
    shape = {"matched": matched, "sharp": setting.get("mouth") == "sharp"}
    probe = ContactProbe(scenario, **shape, **PRESSED)
    g, sizes = scenario.geometry, PegTheory.of(scenario)
    friction = scenario.contact.friction
    size = {"peg_radius": sizes.r, "hole_radius": sizes.R}
    play = measured_two_point_depth(probe, sizes, tilt)
    outside = 1.0 if matched else 1.0 / np.cos(np.pi / g.facets)
    bodies = PegInHole(g.peg_radius, g.hole_radius * outside, g.hole_depth, g.chamfer)
    row = press(probe, sizes, bodies, tilt, force)
    slipping = two_point_push_moment(force, tilt, **size, friction=friction)
    row["moment_error"] = row.pop("moment") / slipping - 1.0
    row["large_overlap_um"] = press(ContactProbe(scenario, **shape, **PRESSED), sizes, bodies, tilt, large_force)[
        "overlap_um"
    ]
    for name, (moment, depth) in SLIDES.items():
        slow = ContactProbe(scenario, **shape, **CRAWLING)
        predicted, measured = crawl(slow, sizes, friction, lateral=0.0, moment=moment, depth=depth)
        row[name] = float(measured.mean()) / predicted - 1.0
    return {"play_depth_error": play / float(two_point_depth(tilt, **size)) - 1.0, **row}


def press(probe: PlanarProbe, sizes: PegTheory, bodies: PegInHole, tilt: float, force: float) -> dict[str, float]:
    """Pushes the peg at a fixed tilt until it is at rest.

    Args:
        probe: moves the peg.
        sizes: of the bodies.
        bodies: the round bodies whose overlap is measured.
        tilt: rad.
        force: axial push, N.

    Returns:
        ``depth_error`` relative to h, ``moment`` that keeps the tilt (N m), ``overlap_um`` of the round bodies, and
        ``cost_ms``, the CPU time of a step.
    """
    h = float(two_point_depth(tilt, peg_radius=sizes.r, hole_radius=sizes.R))
    probe.hold()
    start = sizes.two_point_pose(tilt, h - 2e-5)
    probe.place(PlanarPose(start.x + 1e-7, start.z, tilt))
    probe.hold("tilt")
    probe.load(0.0, -force, 0.0)
    probe.step(round(REST / probe.time_step))
    steps = max(5, round(TIMED / probe.time_step))
    begun = time.process_time()
    probe.step(steps)
    cost = (time.process_time() - begun) / steps
    pose = probe.pose()
    gap = bodies.gap([[pose.x, 0.0, pose.z]], axes_of_rotation_vectors([[0.0, pose.tilt, 0.0]]))[0]
    return {
        "depth_error": (sizes.mouth - pose.z) / h - 1.0,
        "moment": float(probe.contact_load()[2]),
        "overlap_um": max(0.0, -1e6 * gap),
        "cost_ms": 1e3 * cost,
    }


COLUMNS = {
    "play_depth_error": "play depth",
    "depth_error": "depth",
    "moment_error": "moment",
    "overlap_um": "overlap um",
    "large_overlap_um": "large",
    **{name: name.replace("_", " ") for name in SLIDES},
    "cost_ms": "ms a step",
}
"""Titles of the columns, by the key of their values."""


def cell(key: str, value: float) -> str:
    """The text of a value in the table."""
    if key == "cost_ms":
        return f"{value:.2f}"
    if key.endswith("overlap_um"):
        return f"{value:.1f}"
    return f"{100 * value:.2f} %" if key == "play_depth_error" else f"{100 * value:.1f} %"


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--tilt-deg", type=float, default=1.0, help="fixed tilt of the peg, deg (default: 1)")
    parser.add_argument("--force", type=float, default=5.0, help="axial push, N (default: 5)")
    parser.add_argument("--large-force", type=float, default=50.0, help="push for the second overlap, N (default: 50)")
    arguments = parser.parse_args()
    tilt = np.radians(arguments.tilt_deg)
    rows: list[dict[str, Any]] = []
    print(f"{'setting':44}" + "".join(f"{title:>11}" for title in COLUMNS.values()))
    with progress("convergence", 1 + len(SETTINGS)) as advance:
        for setting in [FINEST, *SETTINGS]:
            row = {"setting": setting, **measure(setting, tilt, arguments.force, arguments.large_force)}
            rows.append(row)
            text = ", ".join(f"{name} {value}" for name, value in setting.items()) or "default"
            print(f"{text:44}" + "".join(f"{cell(name, row[name]):>11}" for name in COLUMNS), flush=True)
            advance(text)
    if arguments.json:
        write_json(arguments.json, rows)


if __name__ == "__main__":
    run(main)
