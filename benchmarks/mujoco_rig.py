"""The rig's trials in Drake and in MuJoCo, one by one: do they come out alike, and what does each cost?

    python -m benchmarks.mujoco_rig [--skill FILE] [--trials 20] [--seed 0] [--blind 20] [--scenario nominal]
                                    [--json FILE]                                     needs the extra [peers]

A trial is the same in both: the resolved scenario of its seed (tilt, pivot, friction, sensor noise), the same skill,
and the same motors, sensor, estimator and controller, which are this project's own; only the bodies and their contact
are MuJoCo's (`benchmarks.mujoco_plant`). The first ``--trials`` are controlled by the skill. The next ``--blind`` push
only (gain 0, for 4 s), from the same starts: many jam, so that the engines can disagree. Without ``--skill`` thirty
demonstrations are recorded and learnt first, in Drake.

Times are CPU time of this process. "A step's physics" is for MuJoCo the time in its own step; for Drake it is the time
of a whole trial less what the same systems around the plant cost in the MuJoCo trial, by the step.
"""

from __future__ import annotations

import argparse
import copy
import json
import sys
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from pydrake.systems.framework import DiagramBuilder
from scipy.stats import binomtest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.mujoco_model import MujocoContact  # noqa: E402  (after the path is known)
from benchmarks.mujoco_plant import MujocoPlant  # noqa: E402
from models.scenario import Scenario, load_scenario  # noqa: E402
from skill.manipulation_skill import ManipulationSkill  # noqa: E402
from systems.demonstration_set import demonstrate_all, requests  # noqa: E402
from systems.rig import MakeRig, RigDiagram, WireRig  # noqa: E402
from systems.trial import run_rig, trial_scenario  # noqa: E402

BLIND_TIME = 4.0  # in units of s; what has not gone in by then does not


class TimedPlant(MujocoPlant):
    """
    .. pydrake_system::

        name: TimedPlant
        input_ports:
        - carriage_force
        - gimbal_equilibrium
        output_ports:
        - carriage_state
        - gimbal_state
        - reaction_forces

    Knows how long MuJoCo took, s of CPU, all contexts together; this decides nothing.
    """

    seconds = 0.0

    def advance(self, data: mujoco.MjData) -> None:
        """Takes the period's steps."""
        begun = time.process_time()
        super().advance(data)
        self.seconds += time.process_time() - begun


def wilson(count: int, of: int) -> tuple[float, float]:
    """95 % interval of a share."""
    interval = binomtest(count, of).proportion_ci(method="wilson")
    return float(interval.low), float(interval.high)


def run(rig: RigDiagram, scenario: Scenario, skill: ManipulationSkill, number: int) -> dict[str, Any]:
    """One trial of a built rig, with its cost."""
    begun = time.process_time()
    result, _ = run_rig(rig, scenario, skill, seed=number)
    return asdict(result) | {"cpu_s": time.process_time() - begun}


def pair(scenario: Scenario, skill: ManipulationSkill, contact: MujocoContact, number: int) -> dict[str, Any]:
    """One trial in both engines."""
    drake = run(MakeRig(scenario, skill), scenario, skill, number)
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", TimedPlant(scenario, contact))
    other = run(WireRig(builder, scenario, skill, plant), scenario, skill, number)
    period = scenario.contact.time_step
    around = (other["cpu_s"] - plant.seconds) / (other["time_s"] / period)
    other["physics_ms"] = 1e3 * plant.seconds / (other["time_s"] / contact.time_step)
    drake["physics_ms"] = 1e3 * (drake["cpu_s"] / (drake["time_s"] / period) - around)
    return {"number": number, "friction": scenario.contact.friction, "drake": drake, "mujoco": other}


def summary(pairs: list[dict[str, Any]]) -> dict[str, Any]:
    """Agreement, and the engines beside each other."""
    engines = {name: [p[name] for p in pairs] for name in ("drake", "mujoco")}
    agreed = sum(p["drake"]["inserted"] == p["mujoco"]["inserted"] for p in pairs)
    both = [p for p in pairs if p["drake"]["inserted"] and p["mujoco"]["inserted"]]

    def change(name: str) -> float | None:
        return float(np.median([abs(p["mujoco"][name] - p["drake"][name]) for p in both])) if both else None

    return {
        "trials": len(pairs),
        "agreed": agreed,
        "agreement_interval": wilson(agreed, len(pairs)),
        "same_reason": sum(p["drake"]["reason"] == p["mujoco"]["reason"] for p in pairs),
        "median_difference": {
            name: change(name)
            for name in ("time_s", "depth_mm", "peak_axial_n", "peak_lateral_n", "penetration_um", "steps")
        },
        "largest_depth_difference_mm": max(abs(p["mujoco"]["depth_mm"] - p["drake"]["depth_mm"]) for p in pairs),
    } | {
        name: {
            "inserted": sum(r["inserted"] for r in rows),
            "inserted_interval": wilson(sum(r["inserted"] for r in rows), len(rows)),
            **{
                f"median_{key}": float(np.median([r[key] for r in rows]))
                for key in (
                    "time_s",
                    "depth_mm",
                    "peak_axial_n",
                    "peak_lateral_n",
                    "penetration_um",
                    "cpu_s",
                    "physics_ms",
                )
            },
            "cpu_s_per_simulated_s": sum(r["cpu_s"] for r in rows) / sum(r["time_s"] for r in rows),
        }
        for name, rows in engines.items()
    }


def learn(scenario: Scenario) -> ManipulationSkill:
    """A skill of thirty demonstrations."""
    shown = [d for _, d in demonstrate_all(scenario, requests(24, 6), seed=0, jobs=1)]
    return ManipulationSkill(random_state=0).fit(shown)


def show(name: str, found: dict[str, Any]) -> None:
    """Prints a summary."""
    low, high = found["agreement_interval"]
    print(
        f"{name}: the engines agree on {found['agreed']} of {found['trials']} trials"
        f" (95 % Wilson interval {low:.2f} to {high:.2f}), on the reason in {found['same_reason']}"
    )
    print(f"{'':10} inserted   time s  depth mm  axial N  across N  overlap um   CPU s   CPU s/s  a step's physics ms")
    for engine in ("drake", "mujoco"):
        e = found[engine]
        print(
            f"{engine:10} {e['inserted']:>8} {e['median_time_s']:8.2f} {e['median_depth_mm']:9.2f}"
            f" {e['median_peak_axial_n']:8.1f} {e['median_peak_lateral_n']:9.1f} {e['median_penetration_um']:11.1f}"
            f" {e['median_cpu_s']:7.2f}"
            f" {e['cpu_s_per_simulated_s']:9.2f} {e['median_physics_ms']:20.3f}"
        )
    differences = ", ".join(f"{k} {v:.2g}" for k, v in found["median_difference"].items() if v is not None)
    print(f"median difference where both insert: {differences}\n", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--skill", type=Path, help="a skill file; without it one is taught first")
    parser.add_argument("--scenario", default="nominal")
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--blind", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="number of the first trial")
    parser.add_argument("--json", type=Path, help="write all trials to this file")
    arguments = parser.parse_args()
    scenario = load_scenario(arguments.scenario)
    skill = ManipulationSkill.load(arguments.skill) if arguments.skill else learn(scenario)
    pushing = copy.deepcopy(scenario)
    pushing.controller.gain = 0.0
    pushing.trial.time_limit = min(pushing.trial.time_limit, BLIND_TIME)
    contact = MujocoContact()
    found: dict[str, Any] = {"contact": asdict(contact), "time_step": scenario.contact.time_step}
    for name, chosen, count in (("skill", scenario, arguments.trials), ("blind", pushing, arguments.blind)):
        pairs = []
        for number in range(arguments.seed, arguments.seed + count):
            trial = trial_scenario(chosen, number=number)
            pairs.append(pair(trial, skill, contact, number))
            for engine in ("drake", "mujoco"):
                r = pairs[-1][engine]
                print(
                    f"{name} {number:4d} {engine:7} {r['reason']:10} {r['time_s']:6.2f} s {r['depth_mm']:6.2f} mm"
                    f" {r['peak_axial_n']:6.1f} N along {r['peak_lateral_n']:6.1f} N across, {r['steps']} steps,"
                    f" {r['cpu_s']:.2f} s of CPU",
                    flush=True,
                )
        if pairs:
            found[name] = {"summary": summary(pairs), "trials": pairs}
            show(name, found[name]["summary"])
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps(found, indent=1))


if __name__ == "__main__":
    main()
