"""Performs rig trials of the checkout on PYTHONPATH and prints their CPU times; `benchmarks.rig_cost` starts it.

It uses only functions that checkouts since commit fe53b7b have, and imports nothing from its own folder (run it with
-P).
"""

from __future__ import annotations

import argparse
import json
import time
from importlib import import_module
from pathlib import Path
from typing import Any

import models
from models.scenario import load_scenario
from skill.manipulation_skill import ManipulationSkill

# Older checkouts have the module of the trials, and the time of a result, under another name. The folder is looked at
# because an editable install finds the module of this checkout for the other one.
RUNS = Path(models.__file__).parent.parent / "systems" / "runs"
TRIALS = import_module("experiments.trial" if RUNS.is_dir() else "systems.trial")

WARM_UP = 0.1  # s; time limit of a trial that loads what is loaded on first use


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--skill", type=Path, required=True)
    parser.add_argument("--trials", type=int, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--scenario", required=True)
    parser.add_argument("--mujoco", action="store_true")
    arguments = parser.parse_args()
    skill = ManipulationSkill.load(arguments.skill)
    scenario = load_scenario(arguments.scenario)

    def run(number: int, time_limit: float) -> dict[str, Any]:
        resolved = TRIALS.trial_scenario(scenario, number=number)
        resolved.trial.time_limit = time_limit
        begun = time.process_time()
        if arguments.mujoco:
            from benchmarks.rig.mujoco import run_mujoco
            from systems.plant.mujoco_model import MujocoContact

            row, _ = run_mujoco(resolved, skill, MujocoContact(), number)
            simulated, inserted = row["time_s"], row["inserted"]
        else:
            result, _ = TRIALS.run_trial(resolved, skill, seed=number)
            simulated = result.time if hasattr(result, "time") else result.time_s
            inserted = result.inserted
        spent = time.process_time() - begun
        return {"trial": number, "cpu_s": spent, "simulated_s": float(simulated), "inserted": bool(inserted)}

    run(arguments.seed, WARM_UP)
    numbers = range(arguments.seed, arguments.seed + arguments.trials)
    print(json.dumps([run(number, scenario.trial.time_limit) for number in numbers]))


if __name__ == "__main__":
    main()
