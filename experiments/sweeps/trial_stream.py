"""Performs the missing trials of a sweep and writes their rows as they end."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from experiments.provenance import versions
from experiments.sweeps.assignments import Assignment
from experiments.sweeps.code_digest import Requirements
from experiments.sweeps.policy_store import WAIT, PolicyStore, requirements_of
from experiments.sweeps.result_blocks import Block, HeldBlock, hold
from experiments.sweeps.trial_rows import Row, TrialSource, perform, trial_code
from experiments.worker_pool import LostWorkerError, WorkerPool
from skill.policy import RigPolicy
from skill.skill_step import skill_numbers
from systems.steps.faults import error_summary

WRITE_PERIOD = 1.0
"""Longest time that the row of a trial waits to be written, s."""


MIN_BATCH, MAX_BATCH = 10, 40
"""Numbers of trials of the compiled loop in one task, 0.5 to 2 s: the policy, 0.5 MB for a skill, travels with it."""


@dataclass(frozen=True)
class TrialTask:
    """Performs some trials of a block, in a worker."""

    block: Block
    numbers: tuple[int, ...]
    source: TrialSource
    policy: RigPolicy
    known: dict[str, Any]
    requirements: Requirements

    def __call__(self) -> list[tuple[Block, int, Row | str]]:
        """Returns the row of each trial, or why there is none, and where it belongs."""
        return [(self.block, number, self._row(number)) for number in self.numbers]

    def _row(self, number: int) -> Row | str:
        try:
            self.requirements.check()
            return perform(self.source, self.policy, number, self.known)
        except Exception as error:  # the other trials go on
            return error_summary(error)


@dataclass
class Ended:
    """How the trials of a sweep ended.

    Attributes:
        written: number of rows that were written.
        elsewhere: number of rows that another sweep has written meanwhile.
        failures: reasons why trials have no row, with their numbers.
    """

    written: int = 0
    elsewhere: int = 0
    failures: Counter[str] = field(default_factory=Counter)


class TrialStream:
    """The trials of a sweep that have no row yet.

    Args:
        todo: assignments and the blocks that lack trials, with the number of trials that each lacks.
        store: of the policies.
        pool: whose workers perform the trials.
        advance: is called with a note for each row.

    Attributes:
        ended: how the trials ended, so far.
    """

    def __init__(
        self,
        todo: list[tuple[Assignment, Block, int]],
        store: PolicyStore,
        pool: WorkerPool,
        advance: Callable[[str], None],
    ) -> None:
        self._todo, self._store, self._pool, self._advance = list(todo), store, pool, advance
        self._held: dict[Block, HeldBlock] = {}
        self._in_flight: dict[tuple[Block, int], TrialTask] = {}
        self._given_up: set[tuple[Block, int]] = set()
        self._written_at = time.monotonic()
        self.ended = Ended()

    def run(self) -> Ended:
        """Performs all missing trials; waits for those that another sweep performs.

        Raises:
            OSError: if rows cannot be written. What was written stays.
        """
        try:
            while self._todo:
                busy: list[tuple[Assignment, Block, int]] = []
                self._perform(self._tasks(busy))
                self._todo = busy
                if busy:
                    time.sleep(WAIT)
            return self.ended
        finally:
            try:
                self._write(now=True)
            finally:
                for held in list(self._held.values()):
                    held.release()

    def _perform(self, tasks: Iterator[TrialTask]) -> None:
        """Performs tasks; those that were under way when a worker died are performed again, one at a time."""
        while True:
            try:
                self._take(tasks)
                return
            except LostWorkerError:
                for (_, number), task in list(self._in_flight.items()):
                    self._perform_alone(replace(task, numbers=(number,)))

    def _perform_alone(self, task: TrialTask) -> None:
        """Performs a task of one trial; gives it up if its process dies."""
        try:
            self._take([task])
        except LostWorkerError as error:
            (number,) = task.numbers
            self._fail(task.block, number, f"its process died: {error_summary(error)}")

    def _take(self, tasks: Iterable[TrialTask]) -> None:
        """Takes the results of tasks as they come, and writes them."""
        for result in self._pool.run(self._begun(tasks)):
            for block, number, row in result or ():
                if isinstance(row, str):
                    self._fail(block, number, row)
                else:
                    self._in_flight.pop((block, number), None)
                    self._held[block].add(row)
            self._write()
        self._write(now=True)

    def _begun(self, tasks: Iterable[TrialTask]) -> Iterator[TrialTask]:
        """Yields tasks and notes that they are under way."""
        for task in tasks:
            self._in_flight |= {(task.block, number): task for number in task.numbers}
            yield task

    def _fail(self, block: Block, number: int, reason: str) -> None:
        self._in_flight.pop((block, number), None)
        self._given_up.add((block, number))
        self.ended.failures[reason] += 1
        self._advance(f"trial {number}: {reason}")

    def _write(self, *, now: bool = False) -> None:
        """Writes the rows that wait, if it is time; an error with one block keeps no other from being written."""
        if not now and time.monotonic() - self._written_at < WRITE_PERIOD:
            return
        errors: list[OSError] = []
        for block, held in list(self._held.items()):
            try:
                count = held.write()
            except OSError as error:
                errors.append(error)
                continue
            self.ended.written += count
            for _ in range(count):
                self._advance(held.title)
            if all((block, number) in self._given_up for number in held.missing):
                held.release()
                del self._held[block]
        self._written_at = time.monotonic()
        if errors:
            raise errors[0]

    def _batch(self, missing: int, engine: str, policy: RigPolicy) -> int:
        """Returns how many trials a task has: several only where the compiled loop performs them."""
        if engine != "exact" or skill_numbers(policy) is None:
            return 1
        return min(max(missing // (2 * self._pool.workers), MIN_BATCH), MAX_BATCH)

    def _tasks(self, busy: list[tuple[Assignment, Block, int]]) -> Iterator[TrialTask]:
        """Yields the missing trials of the blocks that no other sweep holds; the others become ``busy``."""
        for assignment, block, expected in self._todo:
            held = hold(block, assignment.source.name)
            if held is None:
                busy.append((assignment, block, expected))
                continue
            missing = sorted(held.missing)
            self.ended.elsewhere += expected - len(missing)
            for _ in range(expected - len(missing)):
                self._advance("by another sweep")
            if not missing:
                held.release()
                continue
            self._held[block] = held
            policy, taught_by = self._store.policy(assignment.policy), assignment.policy.demonstrations
            known = {
                "skill": assignment.policy.digest,
                "demonstrations": policy.demonstrations,
                "demonstration_set": None if taught_by is None else taught_by.seed,
                "train_s": policy.train_s,
                "query_ms": policy.query_ms,
                "code": trial_code(),
                "versions": json.dumps(versions()),
            }
            requirements = requirements_of(assignment.policy.plan)
            size = self._batch(len(missing), assignment.source.engine, policy.policy)
            for start in range(0, len(missing), size):
                numbers = tuple(missing[start : start + size])
                yield TrialTask(block, numbers, assignment.source, policy.policy, known, requirements)
