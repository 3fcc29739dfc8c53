"""Sets of good and bad demonstrations: operators, habits and seeds."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from experiments.demonstration_run import run_demonstration
from experiments.worker_pool import run_in_processes
from models.scenario import DEMONSTRATION_STREAM, Scenario, resolve_scenario
from skill.data.demonstration import Demonstration
from skill.data.outcome import Outcome

GOOD_HABITS = ("expert", "novice")
BAD_HABITS = ("blind", "slams", "gives_up", "overcorrects")
OPERATORS = 10  # number of people who demonstrate in turn: three of thirty demonstrations each
MAX_ATTEMPTS = 50
PATIENCE = 8  # attempts of a person that all end alike, after which the outcome does not depend on luck
SUBSTITUTE = 10**9  # added to the number of a person for the one who takes over
MAX_DEMONSTRATIONS = 10_000  # in one set, so that `attempt_seed` is unique


@dataclass(frozen=True)
class Request:
    """A request for one demonstration.

    Attributes:
        number: number of the demonstration.
        habit: habit of the operator.
        good: whether the demonstration must be good or bad.
    """

    number: int
    habit: str
    good: bool

    @property
    def operator(self) -> int:
        """Number of the person who demonstrates."""
        return self.number % OPERATORS

    @property
    def file_name(self) -> str:
        """Name of the file of the demonstration."""
        return f"{self.number:03d}_{'good' if self.good else 'bad'}_{self.habit}.parquet"


def requests(good: int, bad: int) -> list[Request]:
    """Returns the requests for a set: first the good habits in turn, then the bad habits in turn.

    Raises:
        ValueError: if none or more than `MAX_DEMONSTRATIONS` are requested.
    """
    if not 1 <= good + bad <= MAX_DEMONSTRATIONS:
        limit = f"{MAX_DEMONSTRATIONS:,}"
        raise ValueError(f"{good + bad} demonstrations requested; expected --good plus --bad to be 1 to {limit}")
    habits = [(GOOD_HABITS[i % len(GOOD_HABITS)], True) for i in range(good)]
    habits += [(BAD_HABITS[i % len(BAD_HABITS)], False) for i in range(bad)]
    return [Request(i, habit, outcome) for i, (habit, outcome) in enumerate(habits)]


def attempt_seed(seed: int, number: int, attempt: int) -> int:
    """Returns the seed of one attempt; it is unique for attempt < MAX_ATTEMPTS and number < MAX_DEMONSTRATIONS."""
    return (seed * MAX_DEMONSTRATIONS + number) * MAX_ATTEMPTS + attempt


def demonstrate(scenario: Scenario, request: Request, *, seed: int) -> Demonstration:
    """Repeats a demonstration until it is good or bad, as requested.

    A bad habit may insert by luck from a small tilt, and a good one may fail or end at once. The same person then tries
    again from another start. A person whose first `PATIENCE` attempts all end alike is replaced, once, by another one
    of the same habit. What is no fault with one part, such as slamming into a loose hole, is one with another: after
    that a bad example is tried with the other bad habits. The metadata hold the habit, the number of the person and the
    number of attempts with that habit.

    Raises:
        ValueError: if no attempt is as requested.
    """
    outcomes: list[str] = []
    for habit in [request.habit, *(h for h in BAD_HABITS if not request.good and h != request.habit)]:
        found = _attempt(scenario, request, habit, seed, outcomes)
        if found is not None:
            return found
    kind, remedy = ("good", "") if request.good else ("bad", ", or ask for no bad ones (--bad 0)")
    raise ValueError(
        f"demonstration {request.number}: habit '{request.habit}' gave no {kind} example in {len(outcomes)}"
        f" attempts (outcomes: {sorted(set(outcomes))}); change the operator or the start in the scenario{remedy}"
    )


def _attempt(scenario: Scenario, request: Request, habit: str, seed: int, outcomes: list[str]) -> Demonstration | None:
    """Lets people with a habit try; returns their demonstration, or None if none is as requested; adds outcomes."""
    with_habit = copy.deepcopy(scenario)
    with_habit.operator.habit = habit
    person = seed * OPERATORS + request.operator
    own: list[str] = []
    for attempt in range(MAX_ATTEMPTS):
        number = attempt_seed(seed, request.number, attempt)
        resolved = resolve_scenario(with_habit, seed=number, stream=DEMONSTRATION_STREAM, person=person)
        try:
            demonstration = run_demonstration(resolved)
        except ValueError as error:  # too short, or a wrench that no file may hold
            own.append(str(error))
        else:
            if demonstration.good == request.good and demonstration.outcome is not Outcome.DIVERGED:
                demonstration.metadata.update({"number": number, "operator": person, "attempts": attempt + 1})
                return demonstration
            own.append(demonstration.reason)
        if len(set(own)) == 1 and len(own) == PATIENCE:
            person += SUBSTITUTE
        if len(set(own)) == 1 and len(own) == 2 * PATIENCE:
            break
    outcomes += own
    return None


def demonstrate_all(
    scenario: Scenario, requested: Sequence[Request], *, seed: int, jobs: int
) -> Iterator[tuple[Request, Demonstration]]:
    """Yields the demonstrations in the order of the requests, as they finish, from ``jobs`` processes."""
    tasks = (partial(demonstrate, scenario, request, seed=seed) for request in requested)
    yield from zip(requested, run_in_processes(tasks, jobs=jobs), strict=True)
