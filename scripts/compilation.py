"""Compiles what several processes need, before they do: once on a machine, and announced."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from scripts.command_line import SHIPPED, read_scenario

if TYPE_CHECKING:
    from models.scenario import Geometry, Scenario
    from skill.policy.rig_policy import RigPolicy


def compile_contact(geometry: Geometry) -> None:
    """Compiles the exact gaps and contact labels."""
    import numpy as np

    from models.exact_geometry import contact_labels

    pose = np.zeros((1, 3)), np.eye(3)[None]
    _announced(
        "the exact contact", contact_labels, lambda: (geometry.assembly.gap(*pose), geometry.assembly.label(*pose))
    )


def compile_loop(scenario: Scenario, policy: RigPolicy) -> None:
    """Compiles the loop of trials, if the scenario uses it."""
    from models.arm import RIG
    from systems.rollout import perform

    if scenario.carrier == RIG and scenario.contact.engine == "exact":
        _announced("the loop of trials", perform, lambda: begin_trial(scenario, policy))


def begin_trial(scenario: Scenario, policy: RigPolicy) -> None:
    """Performs 50 ms of a trial by the loop."""
    from experiments.trial.loop_trial import rolled_out
    from experiments.trial.trial_set import TrialSet, trial_scenario

    start = trial_scenario(scenario, number=0, trial_set=TrialSet.USUAL)
    start.trial.time_limit = 0.05
    rolled_out(start, policy, number=0)


def compile_peg() -> None:
    """Compiles the peg of demonstrations in the exact engine."""
    from contextlib import suppress

    from experiments.demonstration_run import run_demonstration
    from models.scenario import DEMONSTRATION_STREAM, resolve_scenario
    from systems.plant.exact_peg import advance_peg

    chosen = read_scenario("nominal", "exact")
    chosen.recorder.time_limit = 0.02

    def begin() -> None:
        with suppress(ValueError):  # too short for a demonstration
            run_demonstration(resolve_scenario(chosen, seed=0, stream=DEMONSTRATION_STREAM))

    _announced("the peg of demonstrations", advance_peg, begin)


def _announced(name: str, function: Callable[..., Any], begin: Callable[[], object]) -> None:
    """Begins what calls a compiled function, if the function is not kept."""
    from compiled import is_kept
    from interfaces.terminal import busy, say

    if not is_kept(function):
        say(f"compiling {name}, once on this machine")
        with busy("compiling"):
            begin()


def main() -> None:
    """Compiles all of it for the nominal scenario and the shipped skill."""
    from skill.manipulation_skill import ManipulationSkill

    chosen = read_scenario("nominal", "exact")
    compile_contact(chosen.geometry)
    compile_loop(chosen, ManipulationSkill.load(SHIPPED))
    compile_peg()


if __name__ == "__main__":
    main()
