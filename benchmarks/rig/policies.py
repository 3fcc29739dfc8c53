"""Policies to compare in sweeps: each function makes one from a `systems.sweeps.policies.Lesson`."""

from __future__ import annotations

from benchmarks.rig.control_laws import StraightPush
from skill.policy import RigPolicy
from systems.sweeps.policies import Lesson


def straight_push(lesson: Lesson) -> RigPolicy:
    """A push without correction, at the feed speed of the simulated operator."""
    return StraightPush(speed=lesson.scenario.operator.insertion_speed)
