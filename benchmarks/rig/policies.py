"""Policies to compare in sweeps: each function makes one from a `experiments.sweep.policies.TrainingContext`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from benchmarks.rig.control_laws import MomentCompliance, SpiralSearch, StraightPush, TunedLaw, tune
from experiments.corrections import CorrectionPlan, StuckTrial, correct, demonstrate_corrections, run_practice
from experiments.sweep.policies import TrainingContext, learn
from experiments.trial.run_trial import run_trials
from skill.data.demonstration import Demonstration
from skill.policy.query_state import QueryState
from skill.policy.rig_policy import RigPolicy


def straight_push(training_context: TrainingContext) -> RigPolicy:
    """A push without correction, at the feed speed of the simulated operator."""
    return StraightPush(speed=training_context.scenario.operator.insertion_speed)


def tuned_compliance(training_context: TrainingContext, candidates: int = 24) -> RigPolicy:
    """Compliance, tuned on other trials of the cell and set of trials."""
    return _tuned(MomentCompliance, training_context, candidates)


def tuned_spiral(training_context: TrainingContext, candidates: int = 24) -> RigPolicy:
    """A spiral search, tuned on other trials of the cell and set of trials."""
    return _tuned(SpiralSearch, training_context, candidates)


def _tuned(law: type[TunedLaw], training_context: TrainingContext, candidates: int) -> RigPolicy:
    trial_set = training_context.trial_set
    if trial_set is None:
        raise ValueError(f"{law.__name__} is tuned for one set of trials: it cannot have for_all_trial_sets")

    def perform(k: int, candidate: TunedLaw, numbers: list[int]) -> list[Mapping[str, Any]]:
        results = run_trials(training_context.scenario, candidate, numbers, jobs=1, trial_set=trial_set)
        return [result.record() for result, _ in results]

    return tune(law, training_context.scenario, candidates, perform)[0]


def corrected(
    training_context: TrainingContext,
    rounds: int = 2,
    trials: int = 24,
    most: int | None = 10,
    share: float = 0.0,
    **options: Any,
) -> RigPolicy:
    """The skill with the corrections that it asks for, as `haptic-skill correct` makes it.

    Args:
        training_context: with demonstrations, in whose scenario the skill practises.
        rounds: of practice, corrections and training, at most.
        trials: practice trials in each round.
        most: corrections in each round, at most; None for ``share`` of the demonstrations.
        share: part of the demonstrations that is left out for each round, the last good and bad ones.
        **options: of the training; see `learn`.
    """
    scenario, seed, shown = training_context.scenario, training_context.seed, training_context.demonstrations
    each = round(share * len(shown))
    plan = CorrectionPlan(rounds=rounds, trials=trials, most=each if most is None else most, seed=seed)
    shown = list(first(shown, len(shown) - rounds * each))

    def practise(policy: RigPolicy, number: int) -> list[StuckTrial]:
        tried = run_practice(scenario, policy, plan.numbers(number), jobs=1)
        return [StuckTrial(state, result) for result, state in tried if state is not None][: plan.most]

    def demonstrate(query_states: Sequence[QueryState], number: int) -> bool:
        corrections = demonstrate_corrections(scenario, dict(enumerate(query_states)), seed=seed, jobs=1)
        shown.extend(correction for _, correction in corrections)
        return True

    def train(*_: Any) -> RigPolicy:
        return learn(replace(training_context, demonstrations=list(shown)), **options)

    return correct(train(), rounds, practise=practise, demonstrate=demonstrate, train=train)


def first(demonstrations: list[Demonstration], number: int) -> list[Demonstration]:
    """Returns the first good and the first bad demonstrations, in the share of the set; at least one is good."""
    good, bad = [d for d in demonstrations if d.good], [d for d in demonstrations if not d.good]
    kept = max(1, round(number * len(good) / len(demonstrations)))
    return [*good[:kept], *bad[: number - kept]]
