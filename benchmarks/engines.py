"""Two cases of two-point contact in MuJoCo: how near to rigid bodies, and at what cost of a step.

    python -m benchmarks.engines [--json FILE]       needs the extra [peers]

Press: a peg whose tilt is held at 1 degree, free along x and z, is pushed with 5 N until it rests on two points (case
of `benchmarks.convergence`); its depth is compared with the exact h(theta). Crawl: a peg with planar freedoms, 20 mm
deep, is loaded with a moment and slides slowly; the axial contact force is compared with Whitney's balance, as in
`benchmarks.theory`.

In MuJoCo the peg is an exact cylinder and the bore a ring of boxes that touch the true circle, without a chamfer; the
plane of motion goes through the middle of a box. Time constants of its contact are given in steps. This is two contact
cases and not the rig: neither controller nor trials run in MuJoCo here.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import mujoco
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.convergence import REST, TIMED, measure  # noqa: E402  (after the path is known)
from models.contact_theory import two_point_axial_force, two_point_depth, two_point_tilt  # noqa: E402
from models.scenario import Scenario  # noqa: E402
from systems.contact_measurements import force_balance  # noqa: E402

CRAWL_DEPTH, CRAWL_MOMENT = 0.020, 4e-3  # m, N m


def model_text(
    boxes: int, step: float, time_constant: float, *, mass: float, inertia: float, drag: tuple[float, float, float]
) -> str:
    """MJCF of a planar peg over the ring of boxes; the origin is the mouth's centre."""
    g = Scenario().geometry
    thickness = 0.005
    ring = []
    for k in range(boxes):
        angle = 2.0 * np.pi * k / boxes
        x, y = (g.hole_radius + thickness) * np.array([np.cos(angle), np.sin(angle)])
        width = (g.hole_radius + thickness) * np.tan(np.pi / boxes)
        ring.append(
            f'<geom type="box" pos="{x:.9f} {y:.9f} {-g.hole_depth / 2}" euler="0 0 {angle:.9f}"'
            f' size="{thickness} {width:.9f} {g.hole_depth / 2}" contype="1" conaffinity="2"/>'
        )
    friction = Scenario().contact.friction
    return f"""
<mujoco>
  <compiler angle="radian"/>
  <option timestep="{step}" gravity="0 0 0" cone="elliptic" integrator="implicitfast"/>
  <default><geom friction="{friction} 0 0" condim="3" solref="{time_constant} 1" solimp="0.95 0.99 0.0001"/></default>
  <worldbody>
    {"".join(ring)}
    <body>
      <joint type="slide" axis="1 0 0" damping="{drag[0]}"/>
      <joint type="slide" axis="0 0 1" damping="{drag[1]}"/>
      <joint type="hinge" axis="0 1 0" damping="{drag[2]}"/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom type="cylinder" size="{g.peg_radius} {g.peg_length / 2}" contype="2" conaffinity="1"
            pos="0 0 {g.peg_length / 2}"/>
    </body>
  </worldbody>
</mujoco>"""


def press(tilt: float, force: float, *, boxes: int, step: float, contact_steps: float) -> dict[str, float]:
    """The peg's depth at rest with its tilt held, and the cost of a step."""
    g = Scenario().geometry
    # So much inertia holds the tilt.
    text = model_text(boxes, step, contact_steps * step, mass=0.5, inertia=1e3, drag=(5.0, 40.0, 1e4))
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    h = float(two_point_depth(tilt, peg_radius=g.peg_radius, hole_radius=g.hole_radius))
    data.qpos[:] = [-(g.hole_radius - g.peg_radius * np.cos(tilt)) + 1e-7, -(h - 2e-5), tilt]
    data.qfrc_applied[:] = [0.0, -force, 0.0]
    mujoco.mj_step(model, data, nstep=round(REST / step))
    count = max(200, round(TIMED / step))
    begun = time.process_time()
    mujoco.mj_step(model, data, nstep=count)
    cost = (time.process_time() - begun) / count
    overlap = max(0.0, -1e6 * min((float(c.dist) for c in data.contact), default=0.0))
    return {"depth_error": -data.qpos[1] / h - 1.0, "overlap_um": overlap, "cost_ms": 1e3 * cost}


def crawl(*, boxes: int, step: float, contact_steps: float) -> float:
    """Mean axial contact force of the crawling peg over the predicted one, less one."""
    scenario = Scenario()
    g, friction = scenario.geometry, scenario.contact.friction
    law = {"peg_radius": g.peg_radius, "friction": friction}
    expected = float(two_point_axial_force(0.0, CRAWL_MOMENT, depth=CRAWL_DEPTH, **law))
    text = model_text(boxes, step, contact_steps * step, mass=0.15, inertia=3e-5, drag=(5.0, 400.0, 0.01))
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    tilt = two_point_tilt(CRAWL_DEPTH, peg_radius=g.peg_radius, hole_radius=g.hole_radius)
    data.qpos[:] = [-(g.hole_radius - g.peg_radius * np.cos(tilt)), -CRAWL_DEPTH, tilt]
    data.qfrc_applied[:] = [0.0, -2.0 * expected, CRAWL_MOMENT]
    mujoco.mj_step(model, data, nstep=round(0.15 / step))
    forces, predicted = [], []
    for _ in range(40):
        mujoco.mj_step(model, data, nstep=max(1, round(5e-4 / step)))
        forces.append(float(data.qfrc_constraint[1]))
        predicted.append(float(two_point_axial_force(0.0, CRAWL_MOMENT, depth=-data.qpos[1], **law)))
    return float(np.mean(forces) / np.mean(predicted) - 1.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments = parser.parse_args()
    tilt, force = np.radians(1.0), 5.0
    scenario = Scenario()
    rows: dict[str, dict[str, float]] = {}
    for setting in ({"corners": "outside"}, {}, {"facets": 32, "modulus": 1e10}):
        text = ", ".join(
            f"{name} {value:g}" if name != "corners" else "corners outside the circle"
            for name, value in setting.items()
        )
        rows[f"Drake, {text or 'corners on the circle'}"] = measure(setting, tilt, force)
    predicted, measured = force_balance(scenario, scenario.contact.friction, depth=CRAWL_DEPTH, shares=[0.0])
    rows["Drake, 3e10 Pa, 0.25 ms"] = {"force_error": float(measured[0] / predicted[0] - 1.0)}
    for step, boxes, contact in ((1e-3, 64, 2.0), (1e-3, 64, 20.0), (1e-3, 256, 2.0), (2.5e-4, 64, 2.0)):
        name = f"MuJoCo, {boxes} boxes, {1e3 * step:g} ms, contact {contact:g} steps"
        settings = {"boxes": boxes, "step": step, "contact_steps": contact}
        rows[name] = press(tilt, force, **settings) | {"force_error": crawl(**settings)}
    print(f"{'':46} {'depth':>8} {'overlap um':>10} {'axial force':>11} {'ms a step':>9}")
    for name, row in rows.items():
        percent = {key: f"{100 * row[key]:.1f} %" if key in row else "-" for key in ("depth_error", "force_error")}
        plain = {key: f"{row[key]:.3f}" if key in row else "-" for key in ("overlap_um", "cost_ms")}
        print(
            f"{name:46} {percent['depth_error']:>8} {plain['overlap_um']:>10} {percent['force_error']:>11}"
            f" {plain['cost_ms']:>9}"
        )
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
