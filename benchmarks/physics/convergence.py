"""Errors of the simulated contact over number of facets, modulus, time step and contact approximation.

    python -m benchmarks.physics.convergence [--tilt-deg 1] [--force 5] [--json FILE]

A peg with a fixed tilt is pushed into two-point contact, free to move sideways, until it is at rest. Columns, one row
per setting:

- play depth: error of the depth at which two-point contact begins, from the meshes alone, relative to the exact h;
- depth: error of the depth at rest under the push, relative to the same h; it includes the compliance of the contact;
- moment: moment that keeps the tilt, relative to the finest setting (256 facets, 0.1 ms, corners on the circle);
- overlap: depth of overlap of the round bodies at rest, by exact geometry, um;
- ms a step: CPU time of a step in contact.

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
from benchmarks.physics.contact_measurements import PegTheory, measured_two_point_depth
from benchmarks.physics.contact_probe import ContactProbe, PlanarPose, PlanarProbe
from models.contact_geometry import PegInHole, axes_of_rotation_vectors
from models.contact_theory import two_point_depth
from models.scenario import Scenario
from systems.reports.terminal import progress, write_json

REST = 0.08  # s; simulated time until the peg is at rest
TIMED = 0.02  # s; simulated time at rest over which the cost of a step is averaged

FINEST = {"facets": 256, "time_step": 1e-4}
SETTINGS: list[dict[str, Any]] = [
    *({"facets": n, "corners": c} for c in ("outside", "on the circle") for n in (32, 64, 128, 256)),
    *({"modulus": E} for E in (1e8, 1e9, 1e10, 1e11)),
    *({"time_step": dt} for dt in (4e-3, 2e-3, 1e-3, 5e-4, 2e-4)),
    *({"approximation": name} for name in ("lagged", "similar", "sap")),
]


def measure(setting: dict[str, Any], tilt: float, force: float) -> dict[str, Any]:
    """The results of one setting.

    Args:
        setting: some of ``facets``, ``corners``, ``modulus``, ``time_step``, ``approximation``; the others are default.
        tilt: of the peg, rad.
        force: axial push, N.
    """
    scenario = copy.deepcopy(Scenario())
    scenario.geometry.facets = setting.get("facets", 64)
    for name in ("modulus", "time_step", "approximation"):
        setattr(scenario.contact, name, setting.get(name, getattr(scenario.contact, name)))
    matched = setting.get("corners", "on the circle") == "on the circle"
    probe = ContactProbe(scenario, matched=matched, mass=0.5, damping=(5.0, 40.0, 0.0))
    g, sizes = scenario.geometry, PegTheory.of(scenario)
    h = float(two_point_depth(tilt, peg_radius=sizes.r, hole_radius=sizes.R))
    play = measured_two_point_depth(probe, sizes, tilt)
    outside = 1.0 if matched else 1.0 / np.cos(np.pi / g.facets)
    bodies = PegInHole(g.peg_radius, g.hole_radius * outside, g.hole_depth, g.chamfer)
    return {"play_depth_error": play / h - 1.0, **press(probe, sizes, bodies, tilt, force)}


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


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--tilt-deg", type=float, default=1.0, help="fixed tilt of the peg, deg (default: 1)")
    parser.add_argument("--force", type=float, default=5.0, help="axial push, N (default: 5)")
    arguments = parser.parse_args()
    tilt = np.radians(arguments.tilt_deg)
    rows: list[dict[str, Any]] = []
    print(f"{'setting':44} {'play depth':>10} {'depth':>8} {'moment':>8} {'overlap um':>10} {'ms a step':>9}")
    with progress("convergence", 1 + len(SETTINGS)) as advance:
        for setting in [FINEST, *SETTINGS]:
            row = {"setting": setting, **measure(setting, tilt, arguments.force)}
            rows.append(row)
            row["moment_error"] = row["moment"] / rows[0]["moment"] - 1.0
            text = ", ".join(f"{name} {value}" for name, value in setting.items())
            print(
                f"{text:44} {100 * row['play_depth_error']:8.2f} % {100 * row['depth_error']:6.1f} %"
                f" {100 * row['moment_error']:6.1f} % {row['overlap_um']:10.1f} {row['cost_ms']:9.2f}",
                flush=True,
            )
            advance(text)
    if arguments.json:
        write_json(arguments.json, rows)


if __name__ == "__main__":
    run(main)
