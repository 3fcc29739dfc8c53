"""Performs the missing trials of a sweep and writes their rows as they end."""

from __future__ import annotations

import json
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from experiments.sweeps.assignments import Assignment
from experiments.sweeps.executors import Executor, LostWorkerError
from experiments.sweeps.policy_store import WAIT, PolicyStore
from experiments.sweeps.requirements import Requirements
from experiments.sweeps.result_blocks import Block, HeldBlock, hold
from experiments.sweeps.trial_rows import Row, TrialSource, engine_versions, perform, trial_code
from skill.policy import RigPolicy
from systems.control.faults import one_line

WRITE_PERIOD = 1.0
"""Longest time that the row of a trial waits to be written, s."""

Advance = Callable[[str], None]
Place = tuple[Block, int]
"""A trial: its block and number."""


@dataclass(frozen=True)
class TrialTask:
    """Performs one trial, in a worker."""

    block: Block
    number: int
    source: TrialSource
    policy: RigPolicy
    known: dict[str, Any]
    requirements: Requirements

    def __call__(self) -> tuple[Block, int, Row | str]:
        """Returns the row of the trial, or why there is none, and where it belongs."""
        try:
            self.requirements.check()
            return self.block, self.number, perform(self.source, self.policy, self.number, self.known)
        except Exception as error:  # the other trials go on
            return self.block, self.number, one_line(error)


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
        executor: that runs the trials.
        advance: is called with a note for each row.

    Attributes:
        ended: how the trials ended, so far.
    """

    def __init__(
        self,
        todo: list[tuple[Assignment, Block, int]],
        store: PolicyStore,
        executor: Executor,
        advance: Advance,
    ) -> None:
        self._todo = [(assignment, block) for assignment, block, _ in todo]
        self._expected = {block: lacking for _, block, lacking in todo}
        self._store, self._executor, self._advance = store, executor, advance
        self._held: dict[Block, HeldBlock] = {}
        self._busy: list[tuple[Assignment, Block]] = []
        self._in_flight: dict[Place, TrialTask] = {}
        self._given_up: set[Place] = set()
        self._lock, self._pass_number = threading.Lock(), 0
        self._written_at = time.monotonic()
        self.ended = Ended()

    def run(self) -> Ended:
        """Performs all missing trials; waits for those that another sweep performs.

        Raises:
            OSError: if rows cannot be written. What was written stays.
        """
        try:
            while self._todo or self._busy:
                self._pass(self._tasks())
                self._todo, self._busy = self._busy, []
                if self._todo:
                    time.sleep(WAIT)
            return self.ended
        finally:
            try:
                self._write(now=True)
            finally:
                for held in list(self._held.values()):
                    held.release()

    def _pass(self, tasks: Iterator[TrialTask]) -> None:
        """Performs tasks; those that were under way when a worker died are performed again."""
        while True:
            try:
                self._take(self._executor.run(self._begun(tasks)))
                return
            except LostWorkerError:
                self._repeat()

    def _repeat(self) -> None:
        """Performs the tasks again that were under way: all together, and if workers die again one at a time."""
        try:
            self._take(self._executor.run(self._begun(iter(self._lost()))))
        except LostWorkerError:
            self._repeat_singly()

    def _lost(self) -> list[TrialTask]:
        """Takes the tasks that were under way; no executor of an earlier pass gets another one."""
        with self._lock:
            self._pass_number += 1
            lost = list(self._in_flight.values())
            self._in_flight.clear()
        return lost

    def _repeat_singly(self) -> None:
        for task in self._lost():
            try:
                self._take(self._executor.run(self._begun(iter([task]))))
            except LostWorkerError as error:
                self._in_flight.clear()
                self._fail(task.block, task.number, f"its process died: {one_line(error)}")

    def _begun(self, tasks: Iterator[TrialTask]) -> Iterator[TrialTask]:
        """Yields tasks and notes that they are under way; ends when a later pass has begun.

        An executor whose workers have died may still ask for tasks, from its own thread.
        """
        with self._lock:
            self._pass_number += 1
            number = self._pass_number

        def pass_tasks() -> Iterator[TrialTask]:
            while True:
                with self._lock:
                    task = next(tasks, None) if number == self._pass_number else None
                    if task is None:
                        return
                    self._in_flight[task.block, task.number] = task
                yield task

        return pass_tasks()

    def _take(self, results: Iterator[tuple[Block, int, Row | str] | None]) -> None:
        """Takes results as they come, and writes them."""
        for result in results:
            if result is not None:
                block, number, row = result
                self._in_flight.pop((block, number), None)
                if isinstance(row, str):
                    self._fail(block, number, row)
                else:
                    self._held[block].add(row)
            self._write()
        self._write(now=True)

    def _fail(self, block: Block, number: int, reason: str) -> None:
        self.ended.failures[reason] += 1
        self._given_up.add((block, number))
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
            for _ in range(count):
                self.ended.written += 1
                self._advance(held.title)
            if all((block, number) in self._given_up for number in held.missing):
                held.release()
                del self._held[block]
        self._written_at = time.monotonic()
        if errors:
            raise errors[0]

    def _tasks(self) -> Iterator[TrialTask]:
        """Yields the missing trials of the blocks that no other sweep holds."""
        while self._todo:
            assignment, block = self._todo.pop(0)
            held = hold(block, assignment.source.name)
            if held is None:
                self._count_elsewhere(block, len(block.missing()))
                self._busy.append((assignment, block))
                continue
            missing = sorted(held.missing)
            self._count_elsewhere(block, len(missing))
            if not missing:
                held.release()
                continue
            made, seed = self._store.policy(assignment.policy), assignment.policy.demonstrations
            requirements = Requirements.of_policy(assignment.source.engine, assignment.policy.plan)
            stored_versions = json.dumps(engine_versions(assignment.source.engine))
            known = {
                **{"skill": assignment.policy.digest, "demonstrations": made.demonstrations},
                **{"demonstration_set": None if seed is None else seed.seed, "train_s": made.train_s},
                **{"query_ms": made.query_ms, "code": trial_code(), "versions": stored_versions},
            }
            self._held[block] = held
            for number in missing:
                yield TrialTask(block, number, assignment.source, made.policy, known, requirements)

    def _count_elsewhere(self, block: Block, lacking: int) -> None:
        """Counts the trials of a block that another sweep has written."""
        for _ in range(self._expected[block] - lacking):
            self.ended.elsewhere += 1
            self._advance("by another sweep")
        self._expected[block] = lacking
