"""Performs the missing trials of a sweep and writes their rows as they end."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import partial

from experiments.provenance import versions
from experiments.sweep.blocks import Block, Row
from experiments.sweep.cells import Cell
from experiments.sweep.code_digest import Requirements, code_digest
from experiments.sweep.policy_store import PolicyStore, requirements_of
from experiments.sweep.trial_rows import perform
from experiments.worker_pool import LostWorkerError, WorkerPool
from systems.law.faults import error_summary

WRITE_PERIOD = 1.0
"""Shortest time between two writings of rows, s."""

Place = tuple[int, int]
"""Number of a block in the list of all, and of a trial in it."""

Task = Callable[[], tuple[Place, Row | str]]


def row_of(place: Place, perform_cell: Callable[[int], Row], requirements: Requirements) -> tuple[Place, Row | str]:
    """Performs a trial, in a worker, and returns its row, or why there is none, with its place.

    Args:
        place: of the row.
        perform_cell: performs a trial of the cell, given its number.
        requirements: of the worker.
    """
    try:
        requirements.check()
        return place, perform_cell(place[1])
    except Exception as error:  # the other trials go on
        return place, error_summary(error)


class SweepRun:
    """The trials of a sweep that have no row yet.

    Args:
        todo: cells, each with a block that lacks trials.
        store: of the policies.
        pool: whose workers perform the trials.
        advance: is called with a note for each row.

    Attributes:
        written: number of rows that were written.
        failures: reasons why trials have no row, with their numbers.
    """

    def __init__(
        self, todo: list[tuple[Cell, Block]], store: PolicyStore, pool: WorkerPool, advance: Callable[[str], None]
    ) -> None:
        self._todo, self._store, self._pool, self._advance = todo, store, pool, advance
        self._begun: dict[Place, Task] = {}
        self._unwritten: set[int] = set()
        self._written_at = time.monotonic()
        self.written = 0
        self.failures: Counter[str] = Counter()

    def run(self) -> None:
        """Performs all missing trials. Those that were under way when a worker died are performed again, one by one.

        Raises:
            OSError: if rows cannot be written. What was written stays.
        """
        try:
            while any(block.missing for _, block in self._todo):
                try:
                    self._take(self._tasks())
                except LostWorkerError:
                    for place, task in list(self._begun.items()):
                        self._perform_alone(place, task)
        finally:
            self._write()

    def _tasks(self) -> Iterator[Task]:
        """Yields the missing trials, and notes that they are under way."""
        for k, (cell, block) in enumerate(self._todo):
            if not block.missing:
                continue
            policy, taught_by = self._store.policy(cell.recipe), cell.recipe.demonstrations
            known = {
                "skill": cell.recipe.digest,
                "demonstrations": policy.demonstrations,
                "demonstration_set": None if taught_by is None else taught_by.seed,
                "train_s": policy.train_s,
                "query_ms": policy.query_ms,
                "code": code_digest(),
                "versions": json.dumps(versions()),
                "factors": cell.factors,
            }
            perform_cell = partial(perform, cell.scenario, cell.trial_set, policy.policy, known=known, cell=cell.digest)
            requirements = requirements_of(cell.recipe.plan)
            for number in sorted(block.missing):
                task = partial(row_of, (k, number), perform_cell, requirements)
                self._begun[k, number] = task
                yield task

    def _perform_alone(self, place: Place, task: Task) -> None:
        """Performs a task; gives it up if its process dies."""
        try:
            self._take([task])
        except LostWorkerError as error:
            self._note(place, f"its process died: {error_summary(error)}")

    def _take(self, tasks: Iterable[Task]) -> None:
        """Takes the results of tasks as they come, and writes them from time to time."""
        for place, row in self._pool.run(tasks):
            self._note(place, row)
            if time.monotonic() - self._written_at >= WRITE_PERIOD:
                self._write()

    def _note(self, place: Place, row: Row | str) -> None:
        """Adds the row of a trial, or the reason why there is none."""
        k, number = place
        cell, block = self._todo[k]
        del self._begun[place]
        if isinstance(row, str):
            block.missing.remove(number)
            self.failures[row] += 1
            self._advance(f"trial {number}: {row}")
        else:
            block.add(row)
            self._unwritten.add(k)
            self._advance(cell.policy)

    def _write(self) -> None:
        """Writes the rows that wait; an error with one block keeps no other from being written."""
        errors: list[OSError] = []
        for k in sorted(self._unwritten):
            try:
                self.written += self._todo[k][1].write()
                self._unwritten.remove(k)
            except OSError as error:
                errors.append(error)
        self._written_at = time.monotonic()
        if errors:
            raise errors[0]
