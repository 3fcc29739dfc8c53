"""Performs the missing trials of a sweep and writes their rows as they end."""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from datetime import UTC, datetime
from functools import partial

from threadpoolctl import threadpool_limits

from experiments.provenance import versions
from experiments.sweep.cell_files import CellFile, Row
from experiments.sweep.cells import Cell
from experiments.sweep.code_digest import code_digest
from experiments.sweep.policies import MadePolicy
from experiments.sweep.policy_store import PolicyStore
from experiments.sweep.trial_files import MEASURED_NUMBERS
from experiments.trial.run_trial import perform_trial
from experiments.trial.trial_result import COUNTS, TrialResult
from experiments.worker_pool import LostWorkerError, WorkerPool
from models.scenario import Scenario, dump_scenario
from systems.law.faults import error_summary

WRITE_PERIOD = 1.0
"""Shortest time between two writings of rows, s."""

Place = tuple[int, int]
"""Number of a file in the list of all, and of a trial in it."""

Trial = Callable[[], tuple[Place, Row | str]]


def row_of(place: Place, cell: Cell, policy: MadePolicy) -> tuple[Place, Row | str]:
    """Performs the trial of a place, in a worker, and returns its row, or why there is none, with the place."""
    try:
        cell.recipe.requirements.check()
        return place, perform(cell, policy, place[1])
    except Exception as error:  # the other trials go on
        return place, error_summary(error)


def perform(cell: Cell, made: MadePolicy, number: int) -> Row:
    """Performs one trial of a cell and returns its row; the trials of a cell may share a rig.

    Raises:
        ValueError: if the scenario has no such trial, or the policy is made for another peg or hole.
    """
    began, cpu, taught_by = datetime.now(UTC), time.process_time(), cell.recipe.demonstrations
    with threadpool_limits(1):
        drawn, result = perform_trial(
            cell.scenario, made.policy, number=number, trial_set=cell.trial_set, cell=cell.digest
        )
    return {
        **result_columns(result),
        **scenario_columns(drawn),
        **{"factors": cell.factors, "skill": cell.recipe.digest, "states": len(made.policy.state_names())},
        **{"demonstrations": made.demonstrations, "demonstration_set": None if taught_by is None else taught_by.seed},
        **{"train_s": made.train_s, "query_ms": made.query_ms, "cpu_s": time.process_time() - cpu},
        **{"code": code_digest(), "versions": json.dumps(versions()), "began": began.isoformat(timespec="seconds")},
    }


def result_columns(result: TrialResult) -> Row:
    """Returns the columns of a result: rounded, in mm, um and degrees, as in ``results.json``."""
    record = result.record()
    pitch, yaw = record["tilt_deg"]
    return {
        **{"trial": result.seed, "inserted": result.inserted, "outcome": result.outcome.value},
        **{"fault": result.fault.name.lower() if result.fault else "", "reason": result.reason},
        **{"trusted": result.trusted, "tilt_x_deg": pitch, "tilt_y_deg": yaw},
        **{name: record[name] for name in (*MEASURED_NUMBERS, *COUNTS) if name in record},
    }


def scenario_columns(scenario: Scenario) -> Row:
    """Returns the columns of a resolved scenario."""
    g, pivot = scenario.geometry, scenario.rig.pivot_height
    return {
        **{"friction": scenario.contact.friction, "pivot_mm": None if pivot is None else 1e3 * pivot},
        **{"peg_radius_mm": 1e3 * g.peg_radius, "hole_radius_mm": 1e3 * g.hole_radius},
        **{"clearance": g.clearance / g.peg_radius, "force_limit_n": scenario.controller.guard.force_limit},
        **{"time_limit_s": scenario.trial.time_limit, "scenario": dump_scenario(scenario)},
    }


class SweepRun:
    """The trials of a sweep that have no row yet.

    Args:
        todo: files of cells that lack trials.
        store: of the policies.
        pool: whose workers perform the trials.
        advance: is called with a note for each row.

    Attributes:
        written: number of rows that were written.
        failures: reasons why trials have no row, with their numbers.
    """

    def __init__(
        self, todo: list[CellFile], store: PolicyStore, pool: WorkerPool, advance: Callable[[str], None]
    ) -> None:
        self._todo, self._store, self._pool, self._advance = todo, store, pool, advance
        self._begun: dict[Place, Trial] = {}
        self._written_at = time.monotonic()
        self.written = 0
        self.failures: Counter[str] = Counter()

    def run(self) -> None:
        """Performs all missing trials. Those that were under way when a worker died are performed again, one by one.

        Raises:
            OSError: if rows cannot be written. What was written stays.
        """
        try:
            while any(file.missing for file in self._todo):
                try:
                    self._take(self._trials())
                except LostWorkerError:
                    self._perform_alone()
        finally:
            self._write()

    def _trials(self) -> Iterator[Trial]:
        """Yields the missing trials, and notes that they are under way."""
        for k, file in enumerate(self._todo):
            if not file.missing:
                continue
            policy = self._store.policy(file.cell.recipe)
            for number in sorted(file.missing):
                self._begun[k, number] = trial = partial(row_of, (k, number), file.cell, policy)
                yield trial

    def _perform_alone(self) -> None:
        """Performs the trials that are under way one by one, and gives up those whose process dies again."""
        for place, trial in list(self._begun.items()):
            try:
                self._take([trial])
            except LostWorkerError as error:
                self._note(place, f"its process died: {error_summary(error)}")

    def _take(self, trials: Iterable[Trial]) -> None:
        """Takes the results of trials as they come, and writes them from time to time."""
        for place, row in self._pool.run(trials):
            self._note(place, row)
            if time.monotonic() - self._written_at >= WRITE_PERIOD:
                self._write()

    def _note(self, place: Place, row: Row | str) -> None:
        """Adds the row of a trial, or the reason why there is none."""
        file, number = self._todo[place[0]], place[1]
        del self._begun[place]
        if isinstance(row, str):
            file.missing.remove(number)
            self.failures[row] += 1
            self._advance(f"trial {number}: {row}")
        else:
            file.add(row)
            self._advance(file.cell.policy)

    def _write(self) -> None:
        """Writes the rows that wait; an error with one file keeps no other from being written."""
        errors: list[OSError] = []
        for file in self._todo:
            try:
                self.written += file.write()
            except OSError as error:
                errors.append(error)
        self._written_at = time.monotonic()
        if errors:
            raise errors[0]
