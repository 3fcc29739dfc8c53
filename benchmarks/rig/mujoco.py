"""The rig's trials in Drake and in MuJoCo, one by one: do they come out alike, and what does each cost?

    python -m benchmarks.rig.mujoco [--skill FILE] [--trials 20] [--seed 0] [--blind 20] [--scenario nominal]
                                    [--json FILE]                                     needs the extra [peers]

A trial is the same in both: the resolved scenario of its seed (tilt, pivot, friction, sensor noise), the same skill,
and the same motors, sensor, estimator and controller, which are this project's own; only the bodies and their contact
are MuJoCo's (`benchmarks.physics.mujoco_plant`). The first ``--trials`` are controlled by the skill. The next
``--blind`` push
only (gain 0, for 4 s), from the same starts: many jam, so that the engines can disagree. Without ``--skill`` thirty
demonstrations are recorded and learnt first, in Drake.

How far two runs part that differ in nothing but the draws of the sensor's noise is measured too, in MuJoCo: engines
cannot agree better than that.

Times are CPU time of this process. "A step's physics" is for MuJoCo the time in its own step; for Drake it is the time
of a whole trial less what the same systems around the plant cost in the MuJoCo trial, by the step.
"""

from __future__ import annotations

import argparse
import copy
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from pydrake.systems.framework import DiagramBuilder

from benchmarks.physics.mujoco_model import MujocoContact
from benchmarks.physics.mujoco_plant import MujocoPlant
from benchmarks.rig.trials import wilson
from models.scenario import Scenario, load_scenario
from skill.manipulation_skill import ManipulationSkill
from systems.reports.terminal import write_json
from systems.rig import MakeRig, RigDiagram, WireRig
from systems.runs.demonstration_set import demonstrate_all, requests
from systems.runs.trial import run_rig, trial_scenario

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


def run(rig: RigDiagram, scenario: Scenario, skill: ManipulationSkill, number: int) -> dict[str, Any]:
    """One trial of a built rig, with its cost."""
    begun = time.process_time()
    result, _ = run_rig(rig, scenario, skill, seed=number)
    return asdict(result) | {"cpu_s": time.process_time() - begun}


def run_mujoco(
    scenario: Scenario, skill: ManipulationSkill, contact: MujocoContact, number: int
) -> tuple[dict[str, Any], float]:
    """One trial in MuJoCo, and the CPU time in s of what is around the plant, by period."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", TimedPlant(scenario, contact))
    row = run(WireRig(builder, scenario, skill, plant), scenario, skill, number)
    row["physics_ms"] = 1e3 * plant.seconds / (row["time_s"] / contact.time_step)
    return row, (row["cpu_s"] - plant.seconds) / (row["time_s"] / scenario.contact.time_step)


def compare(scenario: Scenario, skill: ManipulationSkill, contact: MujocoContact, number: int) -> dict[str, Any]:
    """One trial in both engines, and in MuJoCo with other noise."""
    drake = run(MakeRig(scenario, skill), scenario, skill, number)
    other, around = run_mujoco(scenario, skill, contact, number)
    drake["physics_ms"] = 1e3 * (drake["cpu_s"] / (drake["time_s"] / scenario.contact.time_step) - around)
    noisy = copy.deepcopy(scenario)
    noisy.seed += 1
    again, _ = run_mujoco(noisy, skill, contact, number)
    return {"number": number, "friction": scenario.contact.friction, "drake": drake, "mujoco": other, "again": again}


MEASURED = ("time_s", "depth_mm", "peak_axial_n", "peak_lateral_n", "penetration_um")


def agreement(trials: list[dict[str, Any]], one: str, other: str) -> dict[str, Any]:
    """How far two columns of trials agree; differences are of the trials that insert in both."""
    agreed = sum(t[one]["inserted"] == t[other]["inserted"] for t in trials)
    both = [t for t in trials if t[one]["inserted"] and t[other]["inserted"]]
    return {
        "trials": len(trials),
        "agreed": agreed,
        "interval": wilson(agreed, len(trials)),
        "same_reason": sum(t[one]["reason"] == t[other]["reason"] for t in trials),
        "median_difference": {
            name: float(np.median([abs(t[one][name] - t[other][name]) for t in both])) for name in MEASURED if both
        },
        "largest_depth_difference_mm": max(abs(t[one]["depth_mm"] - t[other]["depth_mm"]) for t in trials),
    }


def summary(trials: list[dict[str, Any]]) -> dict[str, Any]:
    """Agreement, and the engines beside each other."""
    found: dict[str, Any] = {
        "engines": agreement(trials, "drake", "mujoco"),
        "noise": agreement(trials, "mujoco", "again"),
    }
    for engine in ("drake", "mujoco"):
        rows = [t[engine] for t in trials]
        inserted = sum(r["inserted"] for r in rows)
        found[engine] = {
            "inserted": inserted,
            "interval": wilson(inserted, len(rows)),
            **{f"median_{key}": float(np.median([r[key] for r in rows])) for key in (*MEASURED, "cpu_s", "physics_ms")},
            "cpu_s_per_simulated_s": sum(r["cpu_s"] for r in rows) / sum(r["time_s"] for r in rows),
        }
    return found


def learn(scenario: Scenario) -> ManipulationSkill:
    """A skill of thirty demonstrations."""
    shown = [d for _, d in demonstrate_all(scenario, requests(24, 6), seed=0, jobs=1)]
    return ManipulationSkill(random_state=0).fit(shown)


def show(name: str, found: dict[str, Any]) -> None:
    """Prints a summary."""
    titles = ("inserted", "time s", "depth mm", "axial N", "across N", "overlap um", "CPU s", "physics ms", "CPU s/s")
    print(f"\n{name:10}" + "".join(f"{title:>12}" for title in titles))
    for engine in ("drake", "mujoco"):
        e = found[engine]
        medians = "".join(f"{e[f'median_{key}']:12.2f}" for key in (*MEASURED, "cpu_s", "physics_ms"))
        print(f"{engine:10}{e['inserted']:12}{medians}{e['cpu_s_per_simulated_s']:12.2f}")
    for what, a in (("Drake and MuJoCo", found["engines"]), ("MuJoCo and MuJoCo with other noise", found["noise"])):
        low, high = a["interval"]
        differences = ", ".join(f"{key} {value:.2g}" for key, value in a["median_difference"].items())
        print(
            f"{what}: the same outcome in {a['agreed']} of {a['trials']} trials (95 % Wilson interval {low:.2f} to"
            f" {high:.2f}), the same reason in {a['same_reason']};\n    median difference where both insert:"
            f" {differences}; largest of the depth: {a['largest_depth_difference_mm']:.2f} mm",
            flush=True,
        )


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
        trials: list[dict[str, Any]] = []
        for number in range(arguments.seed, arguments.seed + count):
            trial = trial_scenario(chosen, number=number)
            trials.append(compare(trial, skill, contact, number))
            for engine in ("drake", "mujoco", "again"):
                r = trials[-1][engine]
                print(
                    f"{name} {number:4d} {engine:7} {r['reason']:10} {r['time_s']:6.2f} s {r['depth_mm']:6.2f} mm"
                    f" {r['peak_axial_n']:6.1f} N along {r['peak_lateral_n']:6.1f} N across, {r['steps']} steps,"
                    f" {r['cpu_s']:.2f} s of CPU",
                    flush=True,
                )
            found[name] = {"summary": summary(trials), "trials": trials}
            if arguments.json:  # after every trial: a long run that is stopped has not run for nothing
                write_json(arguments.json, found)
        if trials:
            show(name, found[name]["summary"])


if __name__ == "__main__":
    main()
