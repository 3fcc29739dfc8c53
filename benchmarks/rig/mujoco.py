"""Trials of the rig in Drake and in MuJoCo: agreement of their results, and cost.

    python -m benchmarks.rig.mujoco [--skill FILE] [--trials 20] [--seed 0] [--blind 20] [--scenario nominal]
                                    [--json FILE]                                     needs the extra [mujoco]

A trial has the same resolved scenario in both engines (tilt, pivot, friction, sensor noise), the same skill, and the
same motors, sensor, estimator and controller. Only the bodies and their contact are MuJoCo's
(`systems.plant.mujoco_plant`). The first --trials are controlled by a skill. The next --blind only push (gain 0,
for 4 s), from the same starts; many of them jam, so that the engines can disagree.

Each trial is repeated in MuJoCo with other sensor noise ("again"). The engines cannot be expected to agree better than
two such runs.

Columns of the summary, one row per engine: number of insertions; medians of time, depth, largest load, largest normal
force of a single contact, mean load in contact, and overlap of the round bodies; median CPU time of a trial and of the
physics of a step; CPU time per simulated second. The physics of a step is, for MuJoCo, the time in its own step; for
Drake it is the time of a whole trial minus the time of the same systems around the plant in the MuJoCo trial, per step.
"""

from __future__ import annotations

import copy
import time
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import mujoco
import numpy as np
import typer
from pydrake.systems.framework import DiagramBuilder

from benchmarks.command_line import JsonFile, SkillFile, finish, run
from experiments.scoreboard.paired_statistics import wilson
from experiments.trial import run_rig, trial_scenario
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, progress, say, write_json
from models.scenario import Scenario, load_scenario
from scripts.command_line import ScenarioName
from skill.manipulation_skill import ManipulationSkill
from systems.plant.mujoco_model import MujocoContact
from systems.plant.mujoco_plant import MujocoPlant
from systems.rig import MakeRig, WireRig
from systems.rig_diagram import RigDiagram

BLIND_TIME = 4.0  # s; time limit of the blind pushes: later insertions do not occur


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

    A `MujocoPlant` that measures its own cost.

    Attributes:
        seconds: CPU time of MuJoCo's steps in all contexts, s; it does not influence the simulation.
    """

    seconds = 0.0

    def advance(self, data: mujoco.MjData) -> None:
        """Takes the steps of one period."""
        begun = time.process_time()
        super().advance(data)
        self.seconds += time.process_time() - begun


def run_timed(rig: RigDiagram, scenario: Scenario, skill: ManipulationSkill, number: int) -> dict[str, Any]:
    """The result of one trial of a built rig (`TrialResult.record`) with its CPU time."""
    begun = time.process_time()
    result, _ = run_rig(rig, scenario, skill, seed=number)
    return result.record() | {"cpu_s": time.process_time() - begun}


def run_mujoco(
    scenario: Scenario, skill: ManipulationSkill, contact: MujocoContact, number: int
) -> tuple[dict[str, Any], float]:
    """The result of one trial in MuJoCo, and the CPU time per period of the systems around the plant, s."""
    builder = DiagramBuilder()
    plant = builder.AddNamedSystem("plant", TimedPlant(scenario, contact))
    row = run_timed(WireRig(builder, scenario, skill, plant), scenario, skill, number)
    row["physics_ms"] = 1e3 * plant.seconds / (row["time_s"] / contact.time_step)
    return row, (row["cpu_s"] - plant.seconds) / (row["time_s"] / scenario.contact.time_step)


def compare(scenario: Scenario, skill: ManipulationSkill, contact: MujocoContact, number: int) -> dict[str, Any]:
    """The results of one trial in both engines, and in MuJoCo with other sensor noise."""
    drake = run_timed(MakeRig(scenario, skill), scenario, skill, number)
    other, around = run_mujoco(scenario, skill, contact, number)
    drake["physics_ms"] = 1e3 * (drake["cpu_s"] / (drake["time_s"] / scenario.contact.time_step) - around)
    noisy = copy.deepcopy(scenario)
    noisy.seed += 1
    again, _ = run_mujoco(noisy, skill, contact, number)
    return {"number": number, "friction": scenario.contact.friction, "drake": drake, "mujoco": other, "again": again}


TITLES = (
    *("inserted", "time s", "depth mm", "load N", "contact N", "mean load N", "overlap um"),
    *("CPU s", "physics ms", "CPU s/s"),
)
MEASURED = ("time_s", "depth_mm", "peak_load_n", "peak_contact_n", "mean_load_n", "penetration_um")


def agreement(trials: list[dict[str, Any]], one: str, other: str) -> dict[str, Any]:
    """Agreement of two columns of the trials; the median differences are those of the trials that insert in both."""
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
    """Agreement of the trials, and the medians of each engine."""
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


def show(name: str, found: dict[str, Any]) -> None:
    """Prints the result of `summary`."""
    table = plain_table(f"trials, {name}")
    table.add_column("engine")
    for title in TITLES:
        table.add_column(title, justify="right")
    for engine in ("drake", "mujoco"):
        e = found[engine]
        medians = (f"{e[f'median_{key}']:.2f}" for key in (*MEASURED, "cpu_s", "physics_ms"))
        table.add_row(engine, str(e["inserted"]), *medians, f"{e['cpu_s_per_simulated_s']:.2f}")
    console.print(table)
    for pair, a in (("Drake and MuJoCo", found["engines"]), ("MuJoCo with two draws of noise", found["noise"])):
        low, high = a["interval"]
        differences = ", ".join(f"{key} {value:.2g}" for key, value in a["median_difference"].items())
        say(
            f"{pair}: same outcome in {a['agreed']} of {a['trials']} trials (95 % Wilson interval {low:.2f} to"
            f" {high:.2f}), same reason in {a['same_reason']}; median difference where both insert: {differences};"
            f" largest difference in depth: {a['largest_depth_difference_mm']:.2f} mm"
        )


def main(
    skill: SkillFile = Path("out/skill.npz"),
    scenario: ScenarioName = "nominal",
    trials: Annotated[int, typer.Option(min=1, help="Trials controlled by the skill.")] = 20,
    blind: Annotated[int, typer.Option(min=1, help="Trials that only push.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Number of the first trial.")] = 0,
    json: JsonFile = None,
) -> None:
    policy, controlled = ManipulationSkill.load(skill), load_scenario(scenario)
    pushing = copy.deepcopy(controlled)
    pushing.controller.gain = 0.0
    pushing.trial.time_limit = min(pushing.trial.time_limit, BLIND_TIME)
    contact = MujocoContact()
    found: dict[str, Any] = {"contact": asdict(contact), "time_step": controlled.contact.time_step}
    for name, chosen, count in (("skill", controlled, trials), ("blind", pushing, blind)):
        compared: list[dict[str, Any]] = []
        with progress(f"trials, {name}", count) as advance:
            for number in range(seed, seed + count):
                compared.append(compare(trial_scenario(chosen, number=number), policy, contact, number))
                found[name] = {"summary": summary(compared), "trials": compared}
                if json is not None:  # after every trial, so that an interrupted run leaves its results
                    write_json(json, found)
                advance(f"trial {number}: {compared[-1]['drake']['reason']}, {compared[-1]['mujoco']['reason']}")
        show(name, found[name]["summary"])
    finish(found, json)


if __name__ == "__main__":
    run(main)
