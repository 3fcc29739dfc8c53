"""Practice on the rig: rounds of perturbed trials, policy update and check."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from models.scenario import CHECK_STREAM, PRACTICE_STREAM, Scenario, resolve_scenario
from skill.data.rig_run import RigRun
from skill.manipulation_skill import ManipulationSkill
from skill.policy import RigPolicy
from skill.practice.exploration import Cost, ExplorationNoise, PerturbedPolicy, Rollout, rollout_of
from skill.practice.policy_update import AdvantageWeighting, advantage_weighted_update
from systems.runs.trial import run_trial
from systems.runs.trial_result import TrialResult
from systems.runs.worker_pool import run_in_processes


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
        exploration: distribution of the perturbations.
        cost: cost of a trial.
        weighting: parameters of the policy update.
    """

    rounds: int = 4
    starts: int = 8
    checks: int = 8
    seed: int = 0
    exploration: ExplorationNoise = field(default_factory=ExplorationNoise)
    cost: Cost = field(default_factory=Cost)
    weighting: AdvantageWeighting = field(default_factory=AdvantageWeighting)

    @property
    def n_trials(self) -> int:
        """Number of all trials, including the first check."""
        return self.checks + self.rounds * (2 * self.starts + self.checks)


@dataclass(frozen=True)
class Check:
    """The check trials of one skill.

    Attributes:
        results: results of the trials.
        costs: cost of each trial, s.
    """

    results: list[TrialResult]
    costs: list[float]

    def beats(self, other: Check) -> bool:
        """Returns whether this skill costs less on the same trials and inserts at least as often."""
        inserted = sum(r.inserted for r in self.results) >= sum(r.inserted for r in other.results)
        return inserted and sum(self.costs) < sum(other.costs)


@dataclass(frozen=True)
class Round:
    """One round of practice.

    Attributes:
        skill: the best skill so far.
        practised: results of the perturbed trials.
        check: check of the skill that this round produced.
        kept: whether that skill replaced the one before it.
    """

    skill: ManipulationSkill
    practised: list[TrialResult]
    check: Check
    kept: bool


def practise(
    scenario: Scenario,
    skill: ManipulationSkill,
    practice: Practice,
    *,
    jobs: int,
    advance: Callable[[str], None] = lambda note: None,
) -> Iterator[Round]:
    """Yields the rounds as they finish; the first is a check of the initial skill.

    A round performs trials with perturbations of the best skill so far, updates that skill with all rollouts since it
    was found, and checks the result. The starts of practice and checks come from random streams of their own, so they
    differ from those of demonstrations and rig trials.

    Args:
        scenario: with ranges.
        skill: the initial skill; it is not changed.
        practice: parameters.
        jobs: number of processes.
        advance: called with a message after each trial.
    """

    def check_skill(candidate: ManipulationSkill) -> Check:
        numbers = [practice.seed * practice.checks + k for k in range(practice.checks)]
        runs = _run(scenario, [(n, candidate) for n in numbers], CHECK_STREAM, jobs, "check", advance)
        return Check([r for r, _ in runs], [practice.cost.of_run(run) for _, run in runs])

    best, best_check = skill, check_skill(skill)
    yield Round(best, [], best_check, kept=True)
    rollouts: list[Rollout] = []
    for number in range(practice.rounds):
        first = (practice.seed * practice.rounds + number) * practice.starts
        starts = range(first, first + practice.starts)
        trials = [trial for n in starts for trial in _opposite_trials(best, practice, scenario, n)]
        runs = _run(scenario, trials, PRACTICE_STREAM, jobs, f"round {number + 1}", advance)
        rollouts += [rollout_of(run, policy, practice.cost) for (_, policy), (_, run) in zip(trials, runs, strict=True)]
        candidate = advantage_weighted_update(best, rollouts, practice.weighting)
        check = check_skill(candidate)
        kept = check.beats(best_check)
        if kept:
            best, best_check, rollouts = candidate, check, []
        yield Round(best, [r for r, _ in runs], check, kept)


def _opposite_trials(
    skill: ManipulationSkill, practice: Practice, scenario: Scenario, number: int
) -> list[tuple[int, PerturbedPolicy[ManipulationSkill]]]:
    """Returns two trials of one start: with a perturbation and with its opposite."""
    rng = np.random.default_rng([PRACTICE_STREAM, number, 1])  # the start itself is drawn from [stream, number]
    perturbation = practice.exploration.draw(rng, scenario.full_depth)
    return [(number, PerturbedPolicy(skill, p)) for p in (perturbation, perturbation.opposite())]


def _run(
    scenario: Scenario,
    trials: Sequence[tuple[int, RigPolicy]],
    stream: int,
    jobs: int,
    title: str,
    advance: Callable[[str], None],
) -> list[tuple[TrialResult, RigRun]]:
    done = []
    tasks = (
        partial(run_trial, resolve_scenario(scenario, seed=n, stream=stream), policy, seed=n) for n, policy in trials
    )
    for result, run in run_in_processes(tasks, jobs=jobs):
        done.append((result, run))
        advance(f"{title}, trial {result.seed}: {result.reason}, {result.time:.1f} s")
    return done
