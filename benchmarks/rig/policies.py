"""Policies to compare in sweeps: each function makes one from a `systems.sweeps.policies.Lesson`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from benchmarks.rig.control_laws import MomentCompliance, SpiralSearch, StraightPush, TunedLaw, tune
from skill.policy import RigPolicy
from systems.runs.trial import run_trials
from systems.sweeps.policies import Lesson


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
    def perform(k: int, candidate: TunedLaw, numbers: list[int]) -> list[Mapping[str, Any]]:
        results = run_trials(lesson.scenario, candidate, numbers, jobs=1, arm=lesson.arm)
        return [result.record() for result, _ in results]

    return tune(law, lesson.scenario, candidates, perform)[0]
