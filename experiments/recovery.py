"""Recoveries: demonstrations that begin where a policy was stuck.

A policy that imitates visits situations that nobody has shown, because its errors lead it there. The remedy is to let
the policy act, and to demonstrate from the situations that it visits: Ross, Gordon, Bagnell, "A reduction of imitation
learning and structured prediction to no-regret online learning", AISTATS 2011. Here the policy performs practice
trials, a `Situation` is where it was stuck first, and an operator takes over from there in the virtual environment.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from experiments.demonstration_run import run_demonstration
from experiments.demonstration_set import GOOD_HABITS, OPERATORS
from experiments.trial import run_trial
from experiments.trial_result import TrialResult
from experiments.worker_pool import run_in_processes
from models.scenario import QUESTION_STREAM, RECOVERY_STREAM, Scenario, resolve_scenario
from skill.data.demonstration import Demonstration
from skill.data.rig_run import RigRun
from skill.features.measurement import contact_load
from skill.policy import RigPolicy
from skill.practice.situation import Situation

LIFT = 3e-4
"""A recovery begins this much higher than the policy was stuck, m: the peg is held, but not pressed."""

ATTEMPTS = 5
"""Attempts of an operator at one recovery."""


@dataclass(frozen=True)
class StuckTrial:
    """A practice trial in which a policy was stuck.

    Attributes:
        situation: in which it was stuck first.
        result: of the whole trial.
    """

    situation: Situation
    result: TrialResult


def practice_trial(scenario: Scenario, number: int) -> Scenario:
    """Returns the resolved scenario of a practice trial; it shares no random draw with any other trial."""
    return resolve_scenario(scenario, seed=number, stream=QUESTION_STREAM)


def find_situation(run: RigRun, scenario: Scenario, *, number: int, inserted: bool) -> Situation | None:
    """Returns where the policy of a run was stuck first, or None if it was not.

    A policy is stuck when a back-off begins. Without a back-off, a run that did not insert was stuck at its end.

    Args:
        run: of the practice trial.
        scenario: of the practice trial, resolved.
        number: of the trial.
        inserted: whether the trial inserted.
    """
    samples = run.samples
    began = np.flatnonzero(np.diff(samples["guard"].to_numpy(), prepend=0.0) > 0.0)
    if not len(began) and inserted:
        return None
    row = samples.iloc[int(began[0]) if len(began) else -1]
    wrench = row[["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy(dtype=float)
    return Situation(
        trial=number,
        time=float(row["time"]),
        depth=float(row["depth"]),
        tilt=(-float(row["pitch"]), -float(row["yaw"])),  # turning the hole by theta tilts the peg by -theta
        load=contact_load(wrench, scenario.geometry.peg_radius),
        state=run.metadata["state_names"][int(row["state"])],
        pivot_height=float(scenario.rig.pivot_height or 0.0),
        friction=scenario.contact.friction,
    )


def ask(
    scenario: Scenario, policy: RigPolicy, numbers: Sequence[int], *, jobs: int
) -> Iterator[tuple[TrialResult, Situation | None]]:
    """Yields the results of practice trials and where the policy was stuck, in order, as they end."""
    tasks = (partial(_ask, scenario, policy, number) for number in numbers)
    yield from run_in_processes(tasks, jobs=jobs)


def _ask(scenario: Scenario, policy: RigPolicy, number: int) -> tuple[TrialResult, Situation | None]:
    resolved = practice_trial(scenario, number)
    result, run = run_trial(resolved, policy, seed=number)
    return result, find_situation(run, resolved, number=number, inserted=result.inserted)


def recovery_scenario(
    scenario: Scenario, situation: Situation, *, seed: int, stream: int = RECOVERY_STREAM, person: int | None = None
) -> Scenario:
    """Returns the resolved scenario of a recovery: the pose in which the policy was stuck, lifted by ``LIFT``.

    Args:
        scenario: with ranges.
        situation: where the policy was stuck; its pivot and friction replace those of the scenario.
        seed: of the operator's senses.
        stream: random stream of the seed.
        person: number of the operator; None draws a new one.

    Raises:
        ValueError: if a demonstration cannot begin in the situation.
    """
    recovery = copy.deepcopy(scenario)
    recovery.rig.pivot_height = situation.pivot_height
    recovery.contact.friction, recovery.contact.friction_spread = situation.friction, 0.0
    recovery.start.tilt = list(situation.tilt)
    recovery.start.depth = max(0.0, situation.depth - LIFT)  # above the mouth it begins at the usual height
    return resolve_scenario(recovery, seed=seed, stream=stream, person=person)


def habit_of(number: int) -> str:
    """Returns the habit of the operator of a recovery."""
    return GOOD_HABITS[number % len(GOOD_HABITS)]


def demonstrate_recovery(scenario: Scenario, situation: Situation, *, number: int, seed: int) -> Demonstration:
    """Lets an operator take over in a situation, until the demonstration is good or after ``ATTEMPTS`` attempts.

    Args:
        scenario: with ranges.
        situation: where the policy was stuck.
        number: of the recovery; it chooses the operator and the habit, as for demonstrations.
        seed: of the set of demonstrations, whose operators take over.

    Returns:
        The last attempt that a file may hold, which is good or bad.

    Raises:
        ValueError: if no attempt is long enough, or each has a wrench that no file may hold.
    """
    person = seed * OPERATORS + number % OPERATORS
    with_habit = copy.deepcopy(scenario)
    with_habit.operator.habit = habit_of(number)
    demonstration, refusal = None, ""
    for attempt in range(ATTEMPTS):
        senses = situation.trial * ATTEMPTS + attempt
        resolved = recovery_scenario(with_habit, situation, seed=senses, person=person)
        try:
            demonstration = run_demonstration(resolved)
        except ValueError as error:
            refusal = str(error)
            continue
        if demonstration.good:
            break
    if demonstration is None:
        raise ValueError(f"recovery {number}: none of {ATTEMPTS} attempts can be kept ({refusal})")
    about = {"number": number, "operator": person, "attempts": attempt + 1, "recovery": situation.record()}
    demonstration.metadata.update(about)
    return demonstration


def demonstrate_recoveries(
    scenario: Scenario, situations: Mapping[int, Situation], *, seed: int, jobs: int
) -> Iterator[tuple[int, Demonstration]]:
    """Yields numbers and recoveries in the order of ``situations``, as they end, from ``jobs`` processes."""
    tasks = (
        partial(demonstrate_recovery, scenario, situation, number=number, seed=seed)
        for number, situation in situations.items()
    )
    yield from zip(situations, run_in_processes(tasks, jobs=jobs), strict=True)
