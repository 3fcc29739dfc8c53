"""How far the simulated contact is from the rigid bodies, against facets, modulus, time step and approximation.

    python -m benchmarks.physics.convergence [--tilt-deg 1] [--force 5] [--json FILE]

A peg whose tilt is held is pushed into two-point contact and left to come to rest, free sideways. For every setting:

- play depth: where two-point contact begins, from the meshes alone, against the exact h(theta);
- depth: where the peg comes to rest under the push, against the same h(theta): what the compliance adds;
- moment: that keeps the tilt, against the finest setting (256 facets, 0.1 ms, corners on the circles);
- overlap: how deep the peg's circle overlaps the bore's at rest, by exact geometry of the simulated bodies;
- cost: process CPU time of a step in contact.

"corners" is where the corners of the bore's polygon lie: on the true circle, like those of the peg, as `make_bore` has
them, or outside it.
"""

from __future__ import annotations

import argparse
import copy
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.physics.contact_measurements import PegTheory, PlanarProbe, measured_two_point_depth
from benchmarks.physics.contact_probe import ContactProbe, PlanarPose
from models.contact_geometry import PegInHole, axes_of_rotation_vectors
from models.contact_theory import two_point_depth
from models.scenario import Scenario

REST = 0.08  # s, until the peg has come to rest
TIMED = 0.02  # s, of those at rest, over which a step's cost is taken

FINEST = {"facets": 256, "time_step": 1e-4}
SETTINGS: list[dict[str, Any]] = [
    *({"facets": n, "corners": c} for c in ("outside", "on the circle") for n in (32, 64, 128, 256)),
    *({"modulus": E} for E in (1e8, 1e9, 1e10, 1e11)),
    *({"time_step": dt} for dt in (4e-3, 2e-3, 1e-3, 5e-4, 2e-4)),
    *({"approximation": name} for name in ("lagged", "similar", "sap")),
]


def measure(setting: dict[str, Any], tilt: float, force: float) -> dict[str, Any]:
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
    """The peg at rest under a push with its tilt held, and the cost of a step; see the module."""
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tilt-deg", type=float, default=1.0)
    parser.add_argument("--force", type=float, default=5.0, help="axial push, N")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    tilt = np.radians(arguments.tilt_deg)
    finest = measure(FINEST, tilt, arguments.force)
    rows = [{"setting": FINEST, **finest, "moment_error": 0.0}]
    heading = f"{'setting':44} {'play depth':>10} {'depth':>8} {'moment':>8} {'overlap um':>10} {'ms a step':>9}"
    print(heading)
    for setting in [FINEST, *SETTINGS]:
        if setting is not FINEST:
            row = {"setting": setting, **measure(setting, tilt, arguments.force)}
            row["moment_error"] = row["moment"] / finest["moment"] - 1.0
            rows.append(row)
        row = rows[-1]
        text = ", ".join(f"{name} {value}" for name, value in setting.items())
        print(
            f"{text:44} {100 * row['play_depth_error']:8.2f} % {100 * row['depth_error']:6.1f} %"
            f" {100 * row['moment_error']:6.1f} % {row['overlap_um']:10.1f} {row['cost_ms']:9.2f}",
            flush=True,
        )
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
