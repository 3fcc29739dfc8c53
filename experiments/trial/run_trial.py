"""Performs trials: by the compiled loop if it can, else by a diagram."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

from experiments.trial.diagram_trial import kept_rig, run_rig
from experiments.trial.ended_trial import EndedTrial
from experiments.trial.loop_trial import rolled_out
from experiments.trial.trial_result import TrialResult
from experiments.trial.trial_set import TrialSet, trial_scenario
from experiments.worker_pool import run_in_processes
from models.scenario import Scenario
from skill.data.rig_run import RigRun
from skill.policy.rig_policy import RigPolicy
from systems.rig import MakeRig


def run_trials(
    scenario: Scenario, skill: RigPolicy, numbers: list[int], *, jobs: int, trial_set: TrialSet = TrialSet.USUAL
) -> Iterator[tuple[TrialResult, RigRun]]:
    """Yields the trials in the order of their numbers, as they finish, from ``jobs`` processes."""
    tasks = (
        partial(run_trial, trial_scenario(scenario, number=n, trial_set=trial_set), skill, seed=n) for n in numbers
    )
    yield from run_in_processes(tasks, jobs=jobs)


def run_trial(scenario: Scenario, skill: RigPolicy, *, seed: int) -> tuple[TrialResult, RigRun]:
    """Simulates one resolved scenario. An error during the simulation becomes the outcome of the trial.

    Args:
        scenario: resolved (see `resolve_scenario`).
        skill: the policy that controls the rig.
        seed: number of the trial, for the record.

    Raises:
        ValueError: if the policy was made for another peg or hole.
    """
    ended = _ended(scenario, skill, number=seed, cell=None)
    return ended.result, ended.record(skill)


def perform_trial(
    scenario: Scenario, policy: RigPolicy, *, number: int, trial_set: TrialSet, cell: object
) -> tuple[Scenario, TrialResult]:
    """Draws and performs a trial of a scenario with ranges; returns its resolved scenario and its result.

    Args:
        scenario: with ranges.
        policy: that acts.
        number: of the trial.
        trial_set: to which it belongs.
        cell: see `kept_rig`.

    Raises:
        ValueError: if the scenario has no such trial, or the policy was made for another peg or hole.
    """
    drawn = trial_scenario(scenario, number=number, trial_set=trial_set)
    return drawn, _ended(drawn, policy, number=number, cell=cell).result


def _ended(scenario: Scenario, policy: RigPolicy, *, number: int, cell: object | None) -> EndedTrial:
    """Performs a resolved trial by the loop if it can, else by a diagram: that of the cell, or a new one."""
    ended = rolled_out(scenario, policy, number=number)
    if ended is not None:
        return ended
    rig = MakeRig(scenario, policy) if cell is None else kept_rig(cell, scenario, policy)
    return run_rig(rig, scenario, seed=number)
