"""The robot practises: rounds of varied trials, each leaving a skill that must prove itself before it is kept."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from joblib import Parallel, delayed

from models.scenario import CHECK_STREAM, PRACTICE_STREAM, Scenario, resolve_scenario
from skill.data.rig_run import RigRun
from skill.manipulation_skill import ManipulationSkill
from skill.practice.exploration import Cost, ExplorationNoise, PerturbedPolicy, Rollout, rollout_of
from skill.practice.policy_update import AdvantageWeighting, advantage_weighted_update
from systems.runs.trial import run_trial
from systems.runs.trial_result import TrialResult


@dataclass(frozen=True)
class Practice:
    """How much is practised, how boldly, and what counts.

    Attributes:
        rounds: of practice; after each the skill may change.
        starts: of a round's practice trials. Each is tried twice, with a variation and with its opposite, so that no
            way of acting gains by an easy start.
        checks: trials without variation, the same in every round, on which a new skill must beat the old one.
        seed: of the practice's own starts and variations.
        curiosity: of the variations.
        cost: of a trial.
        memory: what becomes of experience.
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
        """Of everything, the first check included."""
        return self.checks + self.rounds * (2 * self.starts + self.checks)


@dataclass(frozen=True)
class Check:
    """What the check trials came to with one skill.

    Attributes:
        results: of the trials.
        costs: of each, s.
    """

    results: list[TrialResult]
    costs: list[float]

    def beats(self, other: Check) -> bool:
        """Whether it costs less on the same trials, and inserts at least as often."""
        inserted = sum(r.inserted for r in self.results) >= sum(r.inserted for r in other.results)
        return inserted and sum(self.costs) < sum(other.costs)


@dataclass(frozen=True)
class Round:
    """One round of practice.

    Attributes:
        skill: the best so far.
        practised: what the varied trials came to.
        check: of the skill that was learnt in this round.
        kept: whether it took the place of the one before.
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
    """Yields the rounds as they are finished, the first being a check of the untouched skill.

    A round tries variations of the best skill so far, learns from all that was tried since that skill was found, and
    checks the outcome. Starts of practice and checks are draws of streams of their own: neither demonstrations nor
    trials of the rig ever meet them.

    Args:
        scenario: with ranges.
        skill: to begin with; it is not changed.
        practice: how.
        jobs: processes.
        advance: called after each trial, with a note.
    """

    def checked(candidate: ManipulationSkill) -> Check:
        numbers = [practice.seed * practice.checks + k for k in range(practice.checks)]
        runs = _run(scenario, [(n, candidate) for n in numbers], CHECK_STREAM, jobs, "check", advance)
        return Check([r for r, _ in runs], [practice.cost.of_run(run) for _, run in runs])

    best, standing = skill, checked(skill)
    yield Round(best, [], standing, kept=True)
    pool: list[Rollout] = []
    for number in range(practice.rounds):
        first = (practice.seed * practice.rounds + number) * practice.starts
        tried = [t for n in range(first, first + practice.starts) for t in _both_ways(best, practice, scenario, n)]
        runs = _run(scenario, tried, PRACTICE_STREAM, jobs, f"round {number + 1}", advance)
        pool += [rollout_of(run, s, practice.cost) for (_, s), (_, run) in zip(tried, runs, strict=True)]
        candidate = advantage_weighted_update(best, pool, practice.weighting)
        check = checked(candidate)
        kept = check.beats(standing)
        if kept:
            best, standing, pool = candidate, check, []
        yield Round(best, [r for r, _ in runs], check, kept)


def _both_ways(
    skill: ManipulationSkill, practice: Practice, scenario: Scenario, number: int
) -> list[tuple[int, PerturbedPolicy]]:
    """One start, numbered, twice."""
    rng = np.random.default_rng([PRACTICE_STREAM, number, 1])  # the start of the trial is a draw of [stream, number]
    perturbation = practice.exploration.draw(rng, scenario.full_depth)
    return [(number, PerturbedPolicy.of(skill, v)) for v in (perturbation, perturbation.opposite())]


def _run(
    scenario: Scenario,
    tried: Sequence[tuple[int, ManipulationSkill]],
    stream: int,
    jobs: int,
    title: str,
    advance: Callable[[str], None],
) -> list[tuple[TrialResult, RigRun]]:
    done = []
    for result, run in Parallel(n_jobs=jobs, return_as="generator")(
        delayed(run_trial)(resolve_scenario(scenario, seed=n, stream=stream), skill, seed=n) for n, skill in tried
    ):
        done.append((result, run))
        advance(f"{title}, trial {result.seed}: {result.reason}, {result.time:.1f} s")
    return done
