"""Rolls out a skill, collects corrections where it gets stuck, and trains again (DAgger).

A policy that imitates visits states that nobody has shown, because its errors lead it there. The remedy is to let the
policy act, and to demonstrate from the states that it visits: Ross, Gordon, Bagnell, "A reduction of imitation learning
and structured prediction to no-regret online learning", AISTATS 2011. Here the policy performs practice trials, a
`QueryState` is where it was stuck first, and an operator takes over from there in the virtual environment. Such a
demonstration is a correction.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from experiments.demonstration_run import run_demonstration
from experiments.demonstration_set import GOOD_HABITS, OPERATORS
from experiments.trial.run_trial import run_trial
from experiments.trial.trial_result import TrialResult
from experiments.worker_pool import run_in_processes
from models.scenario import CORRECTION_STREAM, QUESTION_STREAM, Scenario, parse_scenario, resolve_scenario
from skill.data.demonstration import Demonstration
from skill.data.rig_run import RigRun
from skill.features.measurement import contact_load
from skill.policy.query_state import QueryState
from skill.policy.rig_policy import RigPolicy

LIFT = 3e-4
"""A correction begins this much higher than the policy was stuck, m: the peg is held, but not pressed."""

ATTEMPTS = 5
"""Attempts of an operator at one correction."""

MAX_ROUNDS, MAX_TRIALS = 100, 10_000  # so that the number of a practice trial is unique

P = TypeVar("P", bound=RigPolicy)


@dataclass(frozen=True)
class CorrectionPlan:
    """How much is practised and corrected.

    Attributes:
        rounds: of practice, corrections and training, at most.
        trials: practice trials in each round.
        most: corrections in each round, at most.
        seed: of the demonstrations, whose operators take over, and of the practice trials.
    """

    rounds: int
    trials: int
    most: int
    seed: int

    def numbers(self, round_number: int) -> range:
        """The numbers of the practice trials of a round; the first round is 1."""
        first = (self.seed * MAX_ROUNDS + round_number - 1) * MAX_TRIALS
        return range(first, first + self.trials)


@dataclass(frozen=True)
class StuckTrial:
    """A practice trial in which a policy was stuck.

    Attributes:
        query_state: in which it was stuck first.
        result: of the whole trial.
    """

    query_state: QueryState
    result: TrialResult


def correct(
    policy: P,
    rounds: int,
    *,
    practise: Callable[[P, int], Sequence[StuckTrial]],
    demonstrate: Callable[[Sequence[QueryState], int], bool],
    train: Callable[[P, Sequence[StuckTrial], int], P],
) -> P:
    """Rolls out a policy, collects corrections where it gets stuck, and trains again, once a round.

    A round in which the policy is never stuck, or nothing is demonstrated, is the last.

    Args:
        policy: that acts in the first round.
        rounds: largest number of rounds; they have the numbers from 1 on.
        practise: lets a policy perform the practice trials of a round; returns those in which it was stuck.
        demonstrate: has query states demonstrated in a round; returns whether there is something to learn from.
        train: returns the policy that has learnt from all demonstrations of a round; it gets the one before.

    Returns:
        The policy of the last training; the given one if there was none.
    """
    for number in range(1, rounds + 1):
        stuck = practise(policy, number)
        if not stuck or not demonstrate([trial.query_state for trial in stuck], number):
            break
        policy = train(policy, stuck, number)
    return policy


def practice_trial(scenario: Scenario, number: int) -> Scenario:
    """Returns the resolved scenario of a practice trial; it shares no random draw with any other trial."""
    return resolve_scenario(scenario, seed=number, stream=QUESTION_STREAM)


def find_query_state(run: RigRun, scenario: Scenario, *, number: int, inserted: bool) -> QueryState | None:
    """Returns where the policy of a run was stuck first, or None if it was not.

    A policy is stuck when a back-off begins. Without a back-off, a run that did not insert was stuck at its end.

    Args:
        run: of the practice trial.
        scenario: of the practice trial, resolved.
        number: of the trial.
        inserted: whether the trial inserted.
    """
    samples = run.samples
    began = np.flatnonzero(np.diff(samples["back_off"].to_numpy(), prepend=0.0) > 0.0)
    if not len(began) and inserted:
        return None
    row = samples.iloc[int(began[0]) if len(began) else -1]
    wrench = row[["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy(dtype=float)
    return QueryState(
        trial=number,
        time=float(row["time"]),
        depth=float(row["depth"]),
        tilt=(-float(row["pitch"]), -float(row["yaw"])),  # turning the hole by theta tilts the peg by -theta
        clocking=-float(row["clocking"]),
        load=contact_load(wrench, scenario.geometry.reach),
        state=run.metadata["state_names"][int(row["state"])],
        pivot_height=float(scenario.rig.pivot_height or 0.0),
        friction=scenario.contact.friction,
    )


def run_practice(
    scenario: Scenario, policy: RigPolicy, numbers: Sequence[int], *, jobs: int
) -> Iterator[tuple[TrialResult, QueryState | None]]:
    """Yields the results of practice trials and where the policy was stuck, in order, as they end."""
    tasks = (partial(_run_practice_trial, scenario, policy, number) for number in numbers)
    yield from run_in_processes(tasks, jobs=jobs)


def _run_practice_trial(scenario: Scenario, policy: RigPolicy, number: int) -> tuple[TrialResult, QueryState | None]:
    resolved = practice_trial(scenario, number)
    result, run = run_trial(resolved, policy, seed=number)
    return result, find_query_state(run, resolved, number=number, inserted=result.inserted)


def correction_scenario(
    scenario: Scenario,
    query_state: QueryState,
    *,
    seed: int,
    stream: int = CORRECTION_STREAM,
    person: int | None = None,
) -> Scenario:
    """Returns the resolved scenario of a correction: the pose in which the policy was stuck, lifted by ``LIFT``.

    Args:
        scenario: with ranges.
        query_state: where the policy was stuck; its pivot and friction replace those of the scenario.
        seed: of the operator's senses.
        stream: random stream of the seed.
        person: number of the operator; None draws a new one.

    Raises:
        ValueError: if a demonstration cannot begin in the query state.
    """
    correction = copy.deepcopy(scenario)
    correction.rig.pivot_height = query_state.pivot_height
    correction.contact.friction, correction.contact.friction_spread = query_state.friction, 0.0
    correction.start.tilt, correction.start.clocking = list(query_state.tilt), query_state.clocking
    correction.start.depth = max(0.0, query_state.depth - LIFT)  # above the mouth it begins at the usual height
    return resolve_scenario(correction, seed=seed, stream=stream, person=person)


def begins_in(demonstration: Demonstration, query_state: QueryState, scenario: Scenario) -> bool:
    """Whether a demonstration begins in a query state, in its pose and with its pivot and friction.

    Args:
        demonstration: recorded by this program; others begin in none.
        query_state: where a policy was stuck.
        scenario: of the demonstrations, with ranges.
    """
    text = demonstration.metadata.get("scenario")
    if not isinstance(text, str):
        return False
    found, asked = (
        [
            s.start.tip_height,
            *(s.start.tilt or [0.0, 0.0]),
            s.start.clocking or 0.0,
            s.rig.pivot_height or 0.0,
            s.contact.friction,
        ]
        for s in (parse_scenario(text, demonstration.source), correction_scenario(scenario, query_state, seed=0))
    )
    return np.allclose(found, asked, rtol=1e-6, atol=1e-9)


def habit_of(number: int) -> str:
    """Returns the habit of the operator of a correction."""
    return GOOD_HABITS[number % len(GOOD_HABITS)]


def demonstrate_correction(scenario: Scenario, query_state: QueryState, *, number: int, seed: int) -> Demonstration:
    """Lets an operator take over in a query state, until the demonstration is good or after ``ATTEMPTS`` attempts.

    Args:
        scenario: with ranges.
        query_state: where the policy was stuck.
        number: of the correction; it chooses the operator and the habit, as for demonstrations.
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
        senses = query_state.trial * ATTEMPTS + attempt
        resolved = correction_scenario(with_habit, query_state, seed=senses, person=person)
        try:
            demonstration = run_demonstration(resolved)
        except ValueError as error:
            refusal = str(error)
            continue
        if demonstration.good:
            break
    if demonstration is None:
        raise ValueError(f"correction {number}: none of {ATTEMPTS} attempts can be kept ({refusal})")
    about = {"number": number, "operator": person, "attempts": attempt + 1, "correction": query_state.record()}
    demonstration.metadata.update(about)
    return demonstration


def demonstrate_corrections(
    scenario: Scenario, query_states: Mapping[int, QueryState], *, seed: int, jobs: int
) -> Iterator[tuple[int, Demonstration]]:
    """Yields numbers and corrections in the order of ``query_states``, as they end, from ``jobs`` processes."""
    tasks = (
        partial(demonstrate_correction, scenario, query_state, number=number, seed=seed)
        for number, query_state in query_states.items()
    )
    yield from zip(query_states, run_in_processes(tasks, jobs=jobs), strict=True)
