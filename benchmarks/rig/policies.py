"""Policies to compare in sweeps: each function makes one from a `experiments.sweeps.policies.Lesson`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from benchmarks.rig.control_laws import MomentCompliance, SpiralSearch, StraightPush, TunedLaw, tune
from experiments.recovery import ask, demonstrate_recoveries
from experiments.sweeps.policies import Lesson, learn
from experiments.trial import run_trials
from skill.data.demonstration import Demonstration
from skill.policy import RigPolicy

SET_ROUNDS, ROUND_TRIALS = 100, 10_000
"""Numbers of rounds of a set and of practice trials of a round, as in `scripts.recovery_session`."""


def straight_push(lesson: Lesson) -> RigPolicy:
    """A push without correction, at the feed speed of the simulated operator."""
    return StraightPush(speed=lesson.scenario.operator.insertion_speed)


def tuned_compliance(lesson: Lesson, candidates: int = 24) -> RigPolicy:
    """Compliance, tuned on other trials of the cell and arm."""
    return _tuned(MomentCompliance, lesson, candidates)


def tuned_spiral(lesson: Lesson, candidates: int = 24) -> RigPolicy:
    """A spiral search, tuned on other trials of the cell and arm."""
    return _tuned(SpiralSearch, lesson, candidates)


def _tuned(law: type[TunedLaw], lesson: Lesson, candidates: int) -> RigPolicy:
    arm = lesson.arm
    if arm is None:
        raise ValueError(f"{law.__name__} is tuned for the trials of one arm, so that it cannot have for_all_arms")

    def perform(k: int, candidate: TunedLaw, numbers: list[int]) -> list[Mapping[str, Any]]:
        results = run_trials(lesson.scenario, candidate, numbers, jobs=1, arm=arm)
        return [result.record() for result, _ in results]

    return tune(law, lesson.scenario, candidates, perform)[0]


def recovered(
    lesson: Lesson, rounds: int = 2, trials: int = 24, most: int | None = 10, share: float = 0.0, **options: Any
) -> RigPolicy:
    """The skill with the recoveries that it asks for, as `haptic-skill recover` makes it.

    Args:
        lesson: with demonstrations, in whose scenario the skill practises.
        rounds: of practice, recoveries and training, at most.
        trials: practice trials in each round.
        most: recoveries in each round, at most; None for ``share`` of the demonstrations.
        share: part of the demonstrations that is left out for each round, the last good and bad ones.
        **options: of the training; see `learn`.
    """
    shown = lesson.demonstrations
    each = round(share * len(shown))
    asked = each if most is None else most
    shown = first(shown, len(shown) - rounds * each)
    policy = learn(replace(lesson, demonstrations=shown), **options)
    for number in range(rounds):
        begin = (lesson.seed * SET_ROUNDS + number) * ROUND_TRIALS
        tried = ask(lesson.scenario, policy, range(begin, begin + trials), jobs=1)
        stuck = [situation for _, situation in tried if situation is not None][:asked]
        if not stuck:
            break
        situations = dict(enumerate(stuck))
        shown = [*shown, *(d for _, d in demonstrate_recoveries(lesson.scenario, situations, seed=lesson.seed, jobs=1))]
        policy = learn(replace(lesson, demonstrations=shown), **options)
    return policy


def first(demonstrations: list[Demonstration], number: int) -> list[Demonstration]:
    """Returns the first good and the first bad demonstrations, in the share of the set; at least one is good."""
    good, bad = [d for d in demonstrations if d.good], [d for d in demonstrations if not d.good]
    kept = max(1, round(number * len(good) / len(demonstrations)))
    return [*good[:kept], *bad[: number - kept]]
