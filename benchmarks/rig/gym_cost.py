"""CPU time of the environment of Gymnasium, beside the same trials without it, and the memory that a reset keeps.

    python -m benchmarks.rig.gym_cost [--skill FILE] [--trials 4] [--resets 40] [--json FILE]

The skill performs trials of the default arm from `FIRST_TRIAL` on: by `run_trial`, as an agent in the environment
without labels, and with labels. They alternate, and the environment repeats every record of `run_trial`. The
first reset builds the diagram and is not counted. Times are CPU times of one process with one thread.

Keys of the file: ``reset_ms``, the median of a reset; ``kept_mb``, by how much the process has grown with each further
reset; ``reset_share``, a reset over a trial; ``ratio`` and ``ratio_labels``, CPU time of all trials in the environment
over that of `run_trial`; ``step_ms`` and ``step_labels_ms``, mean of a step with the skill's decision, without the
reset; ``picture_ms``, median of a picture; ``run_trial_s``, mean CPU time of a trial.
"""

from __future__ import annotations

import math
import resource
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import mean, median
from typing import Annotated, Any

import gymnasium
import typer
from threadpoolctl import threadpool_limits

from benchmarks.command_line import JsonFile, SkillFile, finish, run
from experiments.trial import run_trial, trial_scenario
from interfaces.gym.agents import PolicyAgent, run_episode
from interfaces.terminal import console, progress
from models.scenario import load_scenario
from skill.manipulation_skill import ManipulationSkill
from skill.policy import RigPolicy

ENVIRONMENT = "interfaces.gym:PegInHole-v0"
FIRST_TRIAL = 88000
PICTURES = 20
WARM_UP = 5  # resets that are not counted


def cpu_time(call: Callable[[], Any]) -> float:
    """Returns the CPU time of a call, s."""
    began = time.process_time()
    call()
    return time.process_time() - began


def peak_memory() -> float:
    """Returns the largest memory of this process so far, MB."""
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return size / (2**20 if sys.platform == "darwin" else 2**10)


def reset_figures(resets: int) -> dict[str, float]:
    """Returns the figures of resets alone."""
    env = gymnasium.make(ENVIRONMENT, labels=False)
    for _ in range(WARM_UP):
        env.reset(options={"trial": FIRST_TRIAL})
    before = peak_memory()
    times = [cpu_time(partial(env.reset, options={"trial": FIRST_TRIAL + k})) for k in range(resets)]
    return {"reset_ms": 1e3 * median(times), "kept_mb": (peak_memory() - before) / resets}


def picture_time() -> float:
    """Returns the median CPU time of a picture, s; the first one also prepares the renderer."""
    env = gymnasium.make(ENVIRONMENT, labels=False, render_mode="rgb_array")
    env.reset(options={"trial": FIRST_TRIAL})
    env.render()
    return median(cpu_time(env.render) for _ in range(PICTURES))


def trial_figures(skill: RigPolicy, trials: int, reset: float) -> dict[str, float]:
    """Performs the trials with and without the environment.

    Args:
        skill: the policy.
        trials: their number.
        reset: CPU time of a reset, s.

    Raises:
        ValueError: if the environment gives another record than `run_trial`.
    """
    scenario, agent = load_scenario(), PolicyAgent(skill)
    plain, labelled = (gymnasium.make(ENVIRONMENT, policy=skill, labels=labels) for labels in (False, True))
    times: dict[str, list[float]] = {"run_trial": [], "plain": [], "labelled": []}
    steps = 0
    with progress("gym cost", trials) as advance:
        for number in range(FIRST_TRIAL, FIRST_TRIAL + trials):
            records = []
            resolved = trial_scenario(scenario, number=number)
            for name, env in (("run_trial", None), ("plain", plain), ("labelled", labelled)):
                began = time.process_time()
                if env is None:
                    records.append(run_trial(resolved, skill, seed=number)[0].record())
                else:
                    records.append(run_episode(env, agent, trial=number)[1]["trial"])
                times[name].append(time.process_time() - began)
            if any(record != records[0] for record in records):
                raise ValueError(f"trial {number}: {records}; expected the same record three times")
            steps += math.ceil(records[0]["time_s"] / resolved.controller.period)
            advance(records[0]["reason"])
    alone = sum(times["run_trial"])
    return {
        "run_trial_s": mean(times["run_trial"]),
        "reset_share": reset / mean(times["run_trial"]),
        "ratio": sum(times["plain"]) / alone,
        "ratio_labels": sum(times["labelled"]) / alone,
        "step_ms": 1e3 * (sum(times["plain"]) - trials * reset) / steps,
        "step_labels_ms": 1e3 * (sum(times["labelled"]) - trials * reset) / steps,
    }


def main(
    skill: SkillFile = Path("out/skill.npz"),
    trials: Annotated[int, typer.Option(min=1, help="Number of trials.")] = 4,
    resets: Annotated[int, typer.Option(min=1, help="Number of resets.")] = 40,
    json: JsonFile = None,
) -> None:
    policy = ManipulationSkill.load(skill)
    with threadpool_limits(1):
        found = reset_figures(resets)
        found |= trial_figures(policy, trials, 1e-3 * found["reset_ms"])
        found["picture_ms"] = 1e3 * picture_time()
    for name, value in found.items():
        console.print(f"{name:16}{value:8.3g}", highlight=False)
    finish(found, json)


if __name__ == "__main__":
    run(main)
