"""A set of good and bad demonstrations: who shows what, and with which seed."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass

from joblib import Parallel, delayed

from models.scenario import DEMONSTRATION_STREAM, Scenario, resolve_scenario
from skill.data.demonstration import Demonstration
from skill.data.outcome import Outcome
from systems.runs.demonstration_run import run_demonstration

GOOD_HABITS = ("expert", "novice")
BAD_HABITS = ("blind", "slams", "gives_up", "overcorrects")
OPERATORS = 10  # people who show in turn; thirty demonstrations are three by each
MAX_ATTEMPTS = 50


@dataclass(frozen=True)
class Request:
    """One demonstration that is wanted: its number, the habit to show, and whether it is to come out good."""

    number: int
    habit: str
    good: bool

    @property
    def operator(self) -> int:
        """Who shows it."""
        return self.number % OPERATORS


def requests(good: int, bad: int) -> list[Request]:
    """Good habits in turn, then bad habits in turn."""
    wanted = [(GOOD_HABITS[i % len(GOOD_HABITS)], True) for i in range(good)]
    wanted += [(BAD_HABITS[i % len(BAD_HABITS)], False) for i in range(bad)]
    return [Request(i, habit, outcome) for i, (habit, outcome) in enumerate(wanted)]


def attempt_seed(seed: int, number: int, attempt: int) -> int:
    """The seed of one attempt; different for every triple with attempt < MAX_ATTEMPTS and number < 10,000."""
    return (seed * 10_000 + number) * MAX_ATTEMPTS + attempt


def demonstrate(scenario: Scenario, request: Request, *, seed: int) -> Demonstration:
    """Tries until the demonstration comes out as asked, as a person would who is asked for a good or a bad example.

    A bad habit may insert by luck from a small tilt, and a good one may fail; such an attempt is repeated from
    another start by the same person. The number of attempts is in the metadata.

    Raises:
        ValueError: if no attempt comes out as asked.
    """
    shown = copy.deepcopy(scenario)
    shown.operator.habit = request.habit
    person = seed * OPERATORS + request.operator
    outcomes: list[str] = []
    for attempt in range(MAX_ATTEMPTS):
        number = attempt_seed(seed, request.number, attempt)
        resolved = resolve_scenario(shown, seed=number, stream=DEMONSTRATION_STREAM, person=person)
        demonstration = run_demonstration(resolved)
        if demonstration.good == request.good and demonstration.outcome is not Outcome.DIVERGED:
            demonstration.metadata.update({"number": number, "operator": person, "attempts": attempt + 1})
            return demonstration
        outcomes.append(demonstration.reason)
        if len(outcomes) >= 8 and len(set(outcomes)) == 1:
            break  # luck would have shown by now
    wanted = "good" if request.good else "bad"
    raise ValueError(
        f"demonstration {request.number}: habit '{request.habit}' gave no {wanted} example in {len(outcomes)}"
        f" attempts (outcomes: {sorted(set(outcomes))}); change the operator or the start in the scenario"
    )


def demonstrate_all(
    scenario: Scenario, wanted: list[Request], *, seed: int, jobs: int
) -> Iterator[tuple[Request, Demonstration]]:
    """Yields the demonstrations in their order, as they are finished; ``jobs`` processes."""
    results = Parallel(n_jobs=jobs, return_as="generator")(
        delayed(demonstrate)(scenario, request, seed=seed) for request in wanted
    )
    yield from zip(wanted, results, strict=True)
