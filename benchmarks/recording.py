"""Recording of demonstrations, with a progress bar."""

from __future__ import annotations

from collections.abc import Iterator

from experiments.demonstration_set import Request, demonstrate_all
from interfaces.terminal import progress
from models.scenario import Scenario
from skill.data.demonstration import Demonstration


def record_demonstrations(
    scenario: Scenario, wanted: list[Request], *, seed: int, jobs: int = 1
) -> Iterator[tuple[Request, Demonstration]]:
    """Records the demonstrations and yields them in order, as they are finished.

    Args:
        scenario: unresolved.
        wanted: the demonstrations to record.
        seed: seed of the set.
        jobs: number of processes.
    """
    with progress(f"demonstrations, {scenario.fixture} fixture", len(wanted)) as advance:
        for request, demonstration in demonstrate_all(scenario, wanted, seed=seed, jobs=jobs):
            yield request, demonstration
            advance(f"{request.habit}: {demonstration.reason}")
