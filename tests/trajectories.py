"""Small synthetic recordings of an insertion with plausible geometry, statics and motor steps, without a simulation.

A tilted peg touches the mouth with its lower edge and slides down while its tilt decreases. The wall pushes it with a
force proportional to the tilt in excess of 2 c / l, where c is the clearance and l the depth.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd

from skill.data.demonstration import COLUMNS, Demonstration
from skill.data.outcome import Outcome
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
STIFFNESS = 600.0  # in units of N/rad, lateral force per excess tilt
STATE_NAMES = ["free", "on the chamfer", "against the wall", "sliding freely"]


def _insertion(period: float, tilt: float) -> tuple[np.ndarray, ...]:
    """Returns time (s), height of the tip (m), tilt (rad), lateral force (N) and contact state of an insertion.

    Args:
        period: sample period, s.
        tilt: tilt at the start, 3 mm above the mouth, rad.
    """
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
    """A demonstration whose peg starts with ``tilt`` rad in ``direction`` rad about z and is aligned on its way."""
    time, z, angle, push, _ = _insertion(0.02, tilt)
    lean = np.array([np.cos(direction), np.sin(direction)])
    friction = 0.2
    samples = pd.DataFrame(0.0, index=range(len(time)), columns=list(COLUMNS))
    samples["time"], samples["z"], samples["angle"] = time, z, angle
    slack = np.where(z < 0, 5e-5, 2e-4)
    samples["x"], samples["y"] = (-slack * angle / tilt * c for c in lean)
    samples["ax"], samples["ay"] = -lean[1], lean[0]  # a rotation about it tilts the axis towards `direction`
    samples["dangle"] = np.abs(np.diff(angle, prepend=angle[0]))
    samples["fx"], samples["fy"], samples["fz"] = (*(push * c for c in lean), friction * push)
    lever = np.maximum(-z, 0.0) / 2
    samples["mx"], samples["my"] = -lever * push * lean[1], lever * push * lean[0]
    samples["uz"] = np.diff(z, prepend=z[0])
    turn = np.diff(angle, prepend=angle[0])
    samples["rx"], samples["ry"] = -turn * lean[1], turn * lean[0]
    return Demonstration(samples, True, Outcome.INSERTED, {"seed": 1, "geometry": dict(GEOMETRY), **metadata})


def make_rig_run(*, tilt: float = np.radians(3.0), **metadata: Any) -> RigRun:
    """A rig run whose hole turns in steps, by yaw twice as far as by pitch; the controller backs off for 0.1 s.

    Its peg is held between mouth and tip as well, and its context becomes certain from 0.5 s on.
    """
    time, z, angle, push, state = _insertion(0.02, tilt)
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
    samples["back_off"] = ((time > 0.82) & (time < 0.92)).astype(float)
    samples["feed_speed"] = np.where(samples["back_off"] > 0, 0.01, np.gradient(z, time))
    # The peg tilts in the hole by the opposite of the rotation of the hole.
    samples["fx"] = -push * share["yaw"] + 0.05 * rng.standard_normal(len(time))
    samples["fy"] = push * share["pitch"] + 0.05 * rng.standard_normal(len(time))
    samples["fz"] = 0.2 * push + 0.05 * rng.standard_normal(len(time))
    lever = np.maximum(-z, 0.0) / 2
    samples["mx"], samples["my"] = -lever * samples["fy"], lever * samples["fx"]
    turning = np.select([samples["back_off"] > 0, time > 0.95], [0.0, -1.0], default=1.0)
    samples["turning"] = turning
    below = np.minimum(z, 0.0)
    for place, side, height in (("mouth", -1.0, 0.0), ("tip", 1.0, below)):  # a wedge of twice the push
        pushing = np.where(z < 0.0, 2.0 * push, 0.0)
        samples[f"contact_{place}_x"] = 0.01 * side
        samples[f"contact_{place}_z"] = height
        samples[f"contact_{place}_fx"] = -side * pushing
    result = {"inserted": True, "reason": "inserted", "time_s": 2.4, "depth_mm": 24.7}
    record = {"geometry": dict(GEOMETRY), "state_names": list(STATE_NAMES), "force_limit": 50.0, **metadata}
    return RigRun(samples, result, record)
