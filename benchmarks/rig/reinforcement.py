"""A policy of reinforcement learning that is trained briefly, beside the skill, on the same trials.

    python -m benchmarks.rig.reinforcement [--skill FILE] [--steps 20000] [--every 4000] [--trials 20] [--seed 0]
                                           [--scenario nominal] [--json FILE] [--figure FILE]

Soft actor-critic of Stable-Baselines3 (extra [rl]) learns from nothing in ``interfaces.gym:PegInHole-v0``, with the
dense reward and one thread. It sees the observation and commands turns and feed; it gets neither demonstrations nor the
states of the skill. Its training trials are drawn (`FIRST_DRAWN` and above). Before the first step and after every
``--every`` steps it performs ``--trials`` trials of the default arm from `FIRST_TRIAL` on without exploring. So do the
skill and a law that pushes straight on with 10 mm/s. No setting was tuned on these trials.

Columns: steps of training (a step is 20 ms), inserted trials, mean reward of an episode, and medians of the depth at
the end of a trial (mm) and of its largest measured load (N).

Keys of the file: one row for each evaluation (``curve``), the skill and the push (``references``), with the reason of
every trial, and the CPU time of the training so far, s; and the settings. It is written after every evaluation.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
import typer
from gymnasium import spaces
from gymnasium.wrappers import RescaleAction, TransformObservation

from benchmarks.command_line import JsonFile, SkillFile, finish, run
from benchmarks.rig.control_laws import StraightPush
from interfaces.gym.agents import Agent, PolicyAgent, run_episode
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, progress, write_json
from models.scenario import Scenario
from scripts.command_line import ScenarioName
from skill.arrays import Array
from skill.manipulation_skill import ManipulationSkill
from skill.policy import RigPolicy

ENVIRONMENT = "interfaces.gym:PegInHole-v0"
FIRST_TRIAL = 89000
PUSH = 0.010  # in units of m/s
SCALES = {"wrench": (10.0,) * 3 + (0.1,) * 3, "depth": (0.01,), "angles": (0.06,) * 2, "feed": (0.03,)}
"""Sizes (N, N m, m, rad, m/s) by which observations are divided for the networks."""

SETTINGS: dict[str, Any] = {
    "batch_size": 128,
    "buffer_size": 200_000,
    "gamma": 0.99,
    "learning_rate": 1e-3,
    "learning_starts": 1000,
    "policy_kwargs": {"net_arch": [64, 64]},
}


def learning_environment(scenario: str | Scenario) -> gymnasium.Env[Any, Any]:
    """Returns the environment as the networks need it: scaled flat observations, actions within 1."""
    env = gymnasium.make(ENVIRONMENT, scenario=scenario, labels=False)
    parts = env.observation_space
    assert isinstance(parts, spaces.Dict)
    scales = np.concatenate([SCALES.get(name, (1.0,) * spaces.flatdim(box)) for name, box in parts.items()])

    def scaled(observation: Any) -> Array:
        numbers: Array = spaces.flatten(parts, observation) / scales
        return numbers.astype(np.float32)

    flat = spaces.flatten_space(parts)
    assert isinstance(flat, spaces.Box)
    space = spaces.Box((flat.low / scales).astype(np.float32), (flat.high / scales).astype(np.float32))
    return RescaleAction(TransformObservation(env, scaled, space), np.float64(-1.0), np.float64(1.0))


class Learnt:
    """The learnt policy as an `Agent`, without exploration."""

    def __init__(self, model: Any) -> None:
        self._model = model

    def act(self, observation: Any) -> Array:
        """Returns the action for a scaled observation."""
        action, _ = self._model.predict(observation, deterministic=True)
        return np.asarray(action)


def evaluate(env: gymnasium.Env[Any, Any], agent: Agent, trials: int) -> dict[str, Any]:
    """Performs the trials and returns a row; see the module."""
    rewards, records = [], []
    for number in range(FIRST_TRIAL, FIRST_TRIAL + trials):
        reward, info = run_episode(env, agent, trial=number)
        rewards.append(reward)
        records.append(info["trial"])
    return {
        "trials": trials,
        "inserted": sum(record["inserted"] for record in records),
        "reward": float(np.mean(rewards)),
        "depth_mm": float(np.median([record["depth_mm"] for record in records])),
        "peak_measured_load_n": float(np.median([record["peak_measured_load_n"] for record in records])),
        "reasons": [record["reason"] for record in records],
    }


def reference(scenario: str | Scenario, policy: RigPolicy, trials: int) -> dict[str, Any]:
    """Evaluates a policy of the rig."""
    env = gymnasium.make(ENVIRONMENT, scenario=scenario, labels=False, policy=policy)
    return evaluate(env, PolicyAgent(policy), trials)


def learn(scenario: str | Scenario, *, steps: int, every: int, trials: int, seed: int) -> Iterator[dict[str, Any]]:
    """Trains, and yields the rows of the learning curve; ``train_cpu_s`` is the CPU time of the training so far."""
    import torch
    from stable_baselines3 import SAC

    torch.set_num_threads(1)
    env, judged = learning_environment(scenario), learning_environment(scenario)
    model = SAC("MlpPolicy", env, seed=seed, device="cpu", **SETTINGS)
    done, cpu = 0, 0.0
    with progress("reinforcement", steps) as advance:
        while True:
            row = {"steps": done, "train_cpu_s": cpu, **evaluate(judged, Learnt(model), trials)}
            yield row
            if done >= steps:
                return
            began = time.process_time()
            model.learn(every, reset_num_timesteps=False)
            cpu += time.process_time() - began
            for _ in range(model.num_timesteps - done):
                advance(f"{row['inserted']} of {trials} inserted")
            done = int(model.num_timesteps)


def show(curve: Sequence[Mapping[str, Any]], references: Mapping[str, Mapping[str, Any]]) -> None:
    """Prints the table."""
    table = plain_table(f"{curve[0]['trials']} trials from {FIRST_TRIAL} on")
    for name in ("policy", "steps", "inserted", "reward", "depth mm", "load N"):
        table.add_column(name, justify="left" if name == "policy" else "right")
    for name, row in [*(("learnt", row) for row in curve), *references.items()]:
        figures = (f"{row['reward']:.2f}", f"{row['depth_mm']:.1f}", f"{row['peak_measured_load_n']:.1f}")
        table.add_row(name, str(row.get("steps", "")), str(row["inserted"]), *figures)
    console.print(table)


def draw(curve: Sequence[Mapping[str, Any]], references: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Draws inserted trials and mean reward over the steps, with the references as lines."""
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 3.2), layout="constrained")
    steps = [row["steps"] for row in curve]
    for axis, key, label in (
        (axes[0], "inserted", "inserted trials"),
        (axes[1], "reward", "mean reward of an episode"),
    ):
        axis.plot(steps, [row[key] for row in curve], "o-", color="C0", label="reinforcement (SAC)")
        for colour, (name, row) in enumerate(references.items(), 1):
            axis.axhline(row[key], color=f"C{colour}", linestyle="--", label=name)
        axis.set_xlabel("training steps of 20 ms")
        axis.set_ylabel(label)
        axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylim(-0.5, curve[0]["trials"] + 0.5)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def main(
    skill: SkillFile = Path("out/skill.npz"),
    steps: Annotated[int, typer.Option(min=1, help="Steps of training.")] = 20_000,
    every: Annotated[int, typer.Option(min=1, help="Steps between two evaluations.")] = 4000,
    trials: Annotated[int, typer.Option(min=1, help="Trials of an evaluation.")] = 20,
    seed: Annotated[int, typer.Option(help="Seed of the training.")] = 0,
    scenario: ScenarioName = "nominal",
    figure: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw the learning curve into this file.")] = None,
    json: JsonFile = None,
) -> None:
    demonstrated = ManipulationSkill.load(skill)
    references = {
        "skill": reference(scenario, demonstrated, trials),
        "straight push": reference(scenario, StraightPush(PUSH), trials),
    }
    settings = {"algorithm": "SAC", "seed": seed, "first_trial": FIRST_TRIAL, **SETTINGS}
    results: dict[str, Any] = {"curve": [], "references": references, "settings": settings}
    curve = results["curve"]
    for row in learn(scenario, steps=steps, every=every, trials=trials, seed=seed):
        curve.append(row)
        if json is not None:
            write_json(json, results)
    show(curve, references)
    last = curve[-1]
    console.print(f"{last['train_cpu_s']:.0f} s of CPU for {last['steps']} steps of training", highlight=False)
    finish(results, json)
    if figure is not None:
        draw(curve, references, figure)


if __name__ == "__main__":
    run(main)
