"""CPU time of the environment of Gymnasium, beside the same trials without it.

    python -m benchmarks.rig.gym_cost [--skill FILE] [--trials 4] [--resets 40] [--json FILE]

The skill performs trials of the default arm from `FIRST_TRIAL` on: by `run_trial`, as an agent in the environment
without labels, and with labels. They alternate. The first reset builds the diagram and is not counted. Times are CPU
times of one process with one thread.

Keys of the file: ``reset_ms`` and ``picture_ms``, median of a reset and of a picture; ``trial_s``, mean of a trial by
`run_trial`; ``ratio`` and ``ratio_labels``, time of all trials in the environment over that of `run_trial`;
``step_ms``, mean of a step with the skill's decision.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
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

ENVIRONMENT = "interfaces.gym:PegInHole-v0"
FIRST_TRIAL = 88000
PICTURES = 20


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    """Returns the CPU time of a call, s, and what it returns."""
    began = time.process_time()
    found = call()
    return time.process_time() - began, found


def median_ms(call: Callable[[], Any], number: int) -> float:
    """Returns the median CPU time of calls, ms; the first one, which builds what the others use, does not count."""
    call()
    return 1e3 * median(timed(call)[0] for _ in range(number))


def main(
    skill: SkillFile = Path("out/skill.npz"),
    trials: Annotated[int, typer.Option(min=1, help="Number of trials.")] = 4,
    resets: Annotated[int, typer.Option(min=1, help="Number of resets.")] = 40,
    json: JsonFile = None,
) -> None:
    policy, scenario = ManipulationSkill.load(skill), load_scenario()
    agent = PolicyAgent(policy)
    plain = gymnasium.make(ENVIRONMENT, policy=policy, labels=False, render_mode="rgb_array")
    labelled = gymnasium.make(ENVIRONMENT, policy=policy, labels=True)
    first = {"trial": FIRST_TRIAL}
    with threadpool_limits(1):
        reset_ms = median_ms(partial(plain.reset, options=first), resets)
        picture_ms = median_ms(plain.render, PICTURES)
        labelled.reset(options=first)
        seconds = {"alone": 0.0, "plain": 0.0, "labelled": 0.0}
        steps = 0
        with progress("gym cost", trials) as advance:
            for number in range(FIRST_TRIAL, FIRST_TRIAL + trials):
                resolved = trial_scenario(scenario, number=number)
                took, (result, _) = timed(partial(run_trial, resolved, policy, seed=number))
                seconds["alone"] += took
                seconds["plain"] += timed(partial(run_episode, plain, agent, trial=number))[0]
                seconds["labelled"] += timed(partial(run_episode, labelled, agent, trial=number))[0]
                steps += math.ceil(result.time / resolved.controller.period)
                advance(result.reason)
    found = {
        **{"reset_ms": reset_ms, "picture_ms": picture_ms, "trial_s": seconds["alone"] / trials},
        **{name: seconds[part] / seconds["alone"] for name, part in (("ratio", "plain"), ("ratio_labels", "labelled"))},
        "step_ms": (1e3 * seconds["plain"] - trials * reset_ms) / steps,
    }
    for name, value in found.items():
        console.print(f"{name:16}{value:8.3g}", highlight=False)
    finish(found, json)


if __name__ == "__main__":
    run(main)
