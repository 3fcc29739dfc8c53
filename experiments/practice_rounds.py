"""Improves a skill by its own trials on the rig: rounds of perturbed trials, policy update and check."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from experiments.practice_results import Check, Round
from experiments.trial.run_trial import run_trial
from experiments.trial.trial_result import TrialResult
from models.scenario import CHECK_STREAM, PRACTICE_STREAM, Scenario, resolve_scenario
from skill.data.rig_run import RigRun
from skill.manipulation_skill import ManipulationSkill
from skill.practice import (
    PerturbedPolicy,
    Rollout,
    advantage_weighted_update,
    draw_perturbation,
    rollout_of,
    step_costs,
)

Trial = tuple[TrialResult, RigRun]
"""Result and record of a trial."""


@dataclass(frozen=True)
class Practice:
    """Parameters of practice.

    Attributes:
        rounds: number of rounds; each ends with a policy update and a check.
        starts: number of starts per round. Each start is tried twice, with a perturbation and with its opposite, so
            that an easy start favours neither.
        checks: number of check trials. They are not perturbed and the same in every round. A new skill must cost less
            on them than the skill before it.
        seed: seed of the starts and perturbations.
    """

    rounds: int = 4
    starts: int = 8
    checks: int = 8
    seed: int = 0

    @property
    def n_trials(self) -> int:
        """Number of all trials, including the first check."""
        return self.checks + self.rounds * (2 * self.starts + self.checks)


Perform = Callable[[Mapping[str, Callable[[], Trial]]], list[Trial]]
"""Performs trials, which have names of their own in the whole practice, and returns them in order."""


def improve(scenario: Scenario, skill: ManipulationSkill, practice: Practice, *, perform: Perform) -> Iterator[Round]:
    """Improves a skill by its own trials; yields the rounds as they finish, the first a check of the initial skill.

    A round performs trials with perturbations of the best skill so far, updates that skill with all rollouts since it
    was found, and checks the result. The starts of practice and checks come from random streams of their own, so they
    differ from those of demonstrations and rig trials.

    Args:
        scenario: with ranges.
        skill: the initial skill; it is not changed.
        practice: parameters.
        perform: performs the trials, under the names of `trial_names`.
    """

    def check_skill(candidate: ManipulationSkill, round_number: int) -> Check:
        numbers = [practice.seed * practice.checks + k for k in range(practice.checks)]
        tasks = [
            partial(run_trial, resolve_scenario(scenario, seed=n, stream=CHECK_STREAM), candidate, seed=n)
            for n in numbers
        ]
        runs = perform(dict(zip(check_names(round_number, practice.checks), tasks, strict=True)))
        return Check([r for r, _ in runs], [float(step_costs(run).sum()) for _, run in runs])

    best, best_check = skill, check_skill(skill, 0)
    yield Round(best, [], best_check, kept=True)
    rollouts: list[Rollout] = []
    for number in range(practice.rounds):
        first = (practice.seed * practice.rounds + number) * practice.starts
        starts = range(first, first + practice.starts)
        trials = [trial for n in starts for trial in _opposite_trials(best, practice, scenario, n)]
        tasks = [
            partial(run_trial, resolve_scenario(scenario, seed=n, stream=PRACTICE_STREAM), policy, seed=n)
            for n, policy in trials
        ]
        runs = perform(dict(zip(practice_names(number + 1, practice.starts), tasks, strict=True)))
        rollouts += [rollout_of(run, policy) for (_, policy), (_, run) in zip(trials, runs, strict=True)]
        candidate = advantage_weighted_update(best, rollouts)
        check = check_skill(candidate, number + 1)
        kept = check.beats(best_check)
        if kept:
            best, best_check, rollouts = candidate, check, []
        yield Round(best, [r for r, _ in runs], check, kept)


def _opposite_trials(
    skill: ManipulationSkill, practice: Practice, scenario: Scenario, number: int
) -> list[tuple[int, PerturbedPolicy[ManipulationSkill]]]:
    """Returns two trials of one start: with a perturbation and with its opposite."""
    rng = np.random.default_rng([PRACTICE_STREAM, number, 1])  # the start itself is drawn from [stream, number]
    perturbation = draw_perturbation(rng, scenario.full_depth)
    return [(number, PerturbedPolicy(skill, p)) for p in (perturbation, perturbation.opposite())]


def check_names(round_number: int, checks: int) -> list[str]:
    """The names of the check trials of a round; round 0 checks the initial skill."""
    return [f"round_{round_number:04d}_check_{k:04d}.parquet" for k in range(checks)]


def practice_names(round_number: int, starts: int) -> list[str]:
    """The names of the perturbed trials of a round."""
    return [f"round_{round_number:04d}_trial_{k:04d}.parquet" for k in range(2 * starts)]


def trial_names(practice: Practice) -> list[str]:
    """The names of all trials of a practice, in their order."""
    names = check_names(0, practice.checks)
    for number in range(1, practice.rounds + 1):
        names += [*practice_names(number, practice.starts), *check_names(number, practice.checks)]
    return names
