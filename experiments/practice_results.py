"""What the rounds of a practice result in; without Drake."""

from __future__ import annotations

from dataclasses import dataclass

from experiments.trial.trial_result import TrialResult
from skill.manipulation_skill import ManipulationSkill


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
