"""A policy of reinforcement learning that is trained briefly, beside the skill, on the same trials.

    python -m benchmarks.rig.reinforcement [--skill FILE] [--steps 20000] [--every 4000] [--trials 20] [--seed 0]
                                           [--scenario nominal] [--json FILE] [--figure FILE]

Soft actor-critic of Stable-Baselines3 (extra [rl]) learns from nothing in ``interfaces.gym:PegInHole-v0``, on rigid
bodies, with the dense reward and one thread. It sees the measured wrench and depth, as the skill does, and commands
turns and feed; it gets neither demonstrations nor contact states. Its training trials are drawn (`FIRST_DRAWN` and
above). Before the first step and after every ``--every`` steps it performs ``--trials`` trials of the usual set from
`FIRST_TRIAL` on without exploring. So do the skill and a law that pushes straight on with 10 mm/s. No setting was tuned
on these trials.

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
from numpy.typing import ArrayLike

from benchmarks.command_line import JsonFile, SkillFile, finish, run
from benchmarks.rig.control_laws import StraightPush
from experiments.sweep.policies import TrainingContext
from experiments.trial.trial_set import TrialSet
from interfaces.gym.agents import PolicyAgent, run_episode
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, progress, write_json
from models.scenario import Scenario, load_scenario
from scripts.command_line import ScenarioName
from skill.arrays import Array
from skill.features.measurement import measurement
from skill.manipulation_skill import ManipulationSkill
from skill.policy import Action, RigPolicy
from skill.states.estimate import Estimate
from systems.control.control_law import ControlLaw

ENVIRONMENT = "interfaces.gym:PegInHole-v0"
FIRST_TRIAL = 89000
PUSH = 0.010  # in units of m/s
SCALES = np.array([10.0, 10.0, 10.0, 0.1, 0.1, 0.1, 0.01])
"""Sizes (N, N m, m) by which a measurement (7,) is divided for the networks."""

SETTINGS: dict[str, Any] = {
    "batch_size": 128,
    "buffer_size": 200_000,
    "gamma": 0.99,
    "learning_rate": 1e-3,
    "learning_starts": 1000,
    "policy_kwargs": {"net_arch": [64, 64]},
}


def learning_environment(scenario: str | Scenario, trial_set: TrialSet = TrialSet.USUAL) -> gymnasium.Env[Any, Any]:
    """Returns the environment as the networks need it: a scaled measurement, actions within 1."""
    env = gymnasium.make(ENVIRONMENT, scenario=scenario, labels=False, trial_set=trial_set)
    space = spaces.Box(-np.inf, np.inf, SCALES.shape, np.float32)
    env = TransformObservation(env, lambda seen: scaled(measurement(seen["wrench"], seen["depth"][0])), space)
    return RescaleAction(env, np.float64(-1.0), np.float64(1.0))


def scaled(measured: ArrayLike) -> Array:
    """Returns a measurement (7,) in the sizes that the networks need."""
    shares: Array = (np.asarray(measured) / SCALES).astype(np.float32)
    return shares


class LearntLaw(ControlLaw):
    """A learnt policy on the rig, without exploration.

    Args:
        networks: of Stable-Baselines3, whose actions are within 1.
        largest: (3,), the largest turn rates (rad/s) and feed speed (m/s).
    """

    def __init__(self, networks: Any, largest: Array) -> None:
        self._networks, self._largest = networks, largest

    def act(self, measured: ArrayLike, estimate: Estimate) -> Action:
        """See `ControlLaw`."""
        shares, _ = self._networks.predict(scaled(measured), deterministic=True)
        turn_x, turn_y, feed = (self.period_ * self._largest * shares).tolist()
        return Action(np.array([turn_x, turn_y]), feed)


def soft_actor_critic(training_context: TrainingContext, steps: int = 100_000, seed: int = 0) -> LearntLaw:
    """A policy for sweeps that soft actor-critic learns from nothing, in trials of the set, or else in usual ones."""
    trial_set = training_context.trial_set or TrialSet.USUAL
    *_, (law, _, _) = learn(training_context.scenario, trial_set, steps=steps, every=steps, seed=seed)
    return law


def evaluate(scenario: str | Scenario, policy: RigPolicy, trials: int) -> dict[str, Any]:
    """Performs the trials with a policy of the rig and returns a row; see the module."""
    env = gymnasium.make(ENVIRONMENT, scenario=scenario, labels=False, policy=policy)
    rewards, records = [], []
    for number in range(FIRST_TRIAL, FIRST_TRIAL + trials):
        reward, info = run_episode(env, PolicyAgent(policy), trial=number)
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


def learn(
    scenario: str | Scenario, trial_set: TrialSet = TrialSet.USUAL, *, steps: int, every: int, seed: int
) -> Iterator[tuple[LearntLaw, int, float]]:
    """Trains; yields law, steps and CPU time (s) of the training, at its beginning and after every so many steps."""
    import torch
    from stable_baselines3 import SAC

    torch.set_num_threads(1)
    env = learning_environment(scenario, trial_set)
    space = env.unwrapped.action_space
    assert isinstance(space, spaces.Box)
    model = SAC("MlpPolicy", env, seed=seed, device="cpu", **SETTINGS)
    cpu = 0.0
    with progress("reinforcement", steps) as advance:
        while True:
            done = int(model.num_timesteps)
            yield LearntLaw(model.policy, space.high), done, cpu
            if done >= steps:
                return
            began = time.process_time()
            model.learn(every, reset_num_timesteps=False)
            cpu += time.process_time() - began
            for _ in range(model.num_timesteps - done):
                advance("")


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
    chosen = load_scenario(scenario, "exact")  # the fastest engine
    references = {
        "skill": evaluate(chosen, ManipulationSkill.load(skill), trials),
        "straight push": evaluate(chosen, StraightPush(PUSH), trials),
    }
    settings = {"algorithm": "SAC", "seed": seed, "first_trial": FIRST_TRIAL, **SETTINGS}
    results: dict[str, Any] = {"curve": [], "references": references, "settings": settings}
    curve = results["curve"]
    for law, done, cpu in learn(chosen, steps=steps, every=every, seed=seed):
        curve.append({"steps": done, "train_cpu_s": cpu, **evaluate(chosen, law, trials)})
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
