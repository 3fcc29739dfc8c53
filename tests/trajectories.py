"""Small made-up trajectories with the physics of an insertion: geometry, statics and motor steps, but no simulation.

A tilted peg of radius r touches the mouth with its lower edge, slides down as the tilt shrinks, and is pressed against
the wall with a spring's force as long as its tilt exceeds what the clearance allows at that depth, c / (r l)-like.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from skill.data.demonstration import COLUMNS, Demonstration
from skill.data.rig_run import RUN_COLUMNS, RigRun

GEOMETRY = {
    "peg_radius": 0.010,
    "peg_length": 0.060,
    "hole_radius": 0.01005,
    "hole_depth": 0.025,
    "chamfer": 0.0005,
    "facets": 64,
    "block_radius": 0.030,
    "floor": 0.010,
}
STEP = np.radians(0.18)  # in units of rad
STIFFNESS = 600.0  # in units of N/rad, of the lateral force over the excess of the tilt
STATE_NAMES = ["free", "on the chamfer", "against the wall", "sliding freely"]


def _course(period: float, tilt: float) -> tuple[np.ndarray, ...]:
    """Time, height of the tip, tilt and the state, of an insertion that starts ``tilt`` rad off at 3 mm above."""
    time = np.arange(0.0, 2.4, period)
    depth = np.interp(time, [0.0, 0.3, 0.7, 1.6, 2.2, 2.4], [-0.003, 0.0, 0.002, 0.009, 0.0247, 0.0247])
    angle = tilt * np.interp(time, [0.0, 0.35, 1.7, 2.4], [1.0, 1.0, 0.05, 0.02])
    clearance = GEOMETRY["hole_radius"] - GEOMETRY["peg_radius"]
    excess = np.where(depth > 0, np.maximum(0.0, angle - 2 * clearance / np.maximum(depth, 1e-3)), 0.0)
    touching = (depth > -1e-9) & (depth < 1e-3)
    push = STIFFNESS * excess + np.where(touching, 1.5, 0.0)
    state = np.select([depth < -1e-9, touching, push > 0.2], [0, 1, 2], default=3)
    return time, -depth, angle, push, state


def make_demonstration(*, tilt: float = np.radians(2.5), direction: float = 0.9, **metadata: Any) -> Demonstration:
    """The hole stands still; the peg leans by ``tilt`` rad towards ``direction`` rad and is righted on its way."""
    time, z, angle, push, _ = _course(0.02, tilt)
    lean = np.array([np.cos(direction), np.sin(direction)])
    friction = 0.2
    samples = pd.DataFrame(0.0, index=range(len(time)), columns=list(COLUMNS))
    samples["time"], samples["z"], samples["angle"] = time, z, angle
    slack = np.where(z < 0, 5e-5, 2e-4)
    samples["x"], samples["y"] = (-slack * angle / tilt * c for c in lean)
    samples["ax"], samples["ay"] = -lean[1], lean[0]  # turning about it leans the axis towards `direction`
    samples["dangle"] = np.abs(np.diff(angle, prepend=angle[0]))
    samples["fx"], samples["fy"], samples["fz"] = (*(push * c for c in lean), friction * push)
    lever = np.maximum(-z, 0.0) / 2
    samples["mx"], samples["my"] = -lever * push * lean[1], lever * push * lean[0]
    samples["uz"] = np.diff(z, prepend=z[0])
    turn = np.diff(angle, prepend=angle[0])
    samples["rx"], samples["ry"] = -turn * lean[1], turn * lean[0]
    return Demonstration(samples, True, "inserted", {"seed": 1, "geometry": dict(GEOMETRY), **metadata})


def make_rig_run(*, tilt: float = np.radians(3.0), **metadata: Any) -> RigRun:
    """The hole turns in steps, by pitch and twice as far by yaw; the force guard acts for a moment."""
    time, z, angle, push, state = _course(0.02, tilt)
    rng = np.random.default_rng(7)
    samples = pd.DataFrame(0.0, index=range(len(time)), columns=list(RUN_COLUMNS))
    share = {"pitch": 1 / np.sqrt(5), "yaw": -2 / np.sqrt(5)}
    for name, part in share.items():
        steps = np.rint((angle - angle[0]) * part / STEP)
        samples[f"target_{name}"] = steps * STEP
        samples[f"{name}_taken"] = np.abs(np.diff(steps, prepend=0)).cumsum()
        samples[name] = angle[0] * part + steps * STEP
    samples["time"], samples["depth"], samples["tip_z"], samples["state"] = time, -z, z, state
    samples["known"] = samples["support"] = 1.0
    samples["guard"] = ((time > 0.82) & (time < 0.92)).astype(float)
    samples["feed_speed"] = np.where(samples["guard"] > 0, 0.01, np.gradient(z, time))
    # Leaning of the peg in the hole: against the hole's own turn.
    samples["fx"] = -push * share["yaw"] + 0.05 * rng.standard_normal(len(time))
    samples["fy"] = push * share["pitch"] + 0.05 * rng.standard_normal(len(time))
    samples["fz"] = 0.2 * push + 0.05 * rng.standard_normal(len(time))
    lever = np.maximum(-z, 0.0) / 2
    samples["mx"], samples["my"] = -lever * samples["fy"], lever * samples["fx"]
    result = {"inserted": True, "reason": "inserted", "time_s": 2.4, "depth_mm": 24.7}
    record = {"geometry": dict(GEOMETRY), "state_names": list(STATE_NAMES), "force_limit": 50.0, **metadata}
    return RigRun(samples, result, record)
