"""The processes that simulate: the one place that starts them. They end soon after their parent, however it ends."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from functools import partial
from typing import Any, TypeVar

from joblib.externals.loky import get_reusable_executor
from joblib.externals.loky.backend.reduction import dumps, loads

R = TypeVar("R")

WATCH_PERIOD = 1.0
"""Time between two looks at the parent, or for what has happened to the workers, s."""

IDLE_TIME = 300
"""Time after which a process without a task ends, s."""

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS"), "1")
"""Environment of the processes: there is one for each core."""

LOSSES = {"TerminatedWorkerError", "BrokenProcessPool", "KilledWorker", "WorkerCrashedError"}
"""Names of the exceptions by which loky, Dask and Ray tell that a worker has died."""


class LostWorkerError(RuntimeError):
    """A worker process has died, and with it the task that it had begun."""


class WorkerPool:
    """Runs tasks in processes of this machine, which are started for the first task; a context manager.

    Args:
        jobs: number of processes.
    """

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs

    def __enter__(self) -> WorkerPool:
        """Does nothing yet."""
        return self

    def __exit__(self, *_: object) -> None:
        """Ends the connection to a cluster; processes of this machine wait for more tasks."""

    @property
    def workers(self) -> int:
        """Number of tasks that run at the same time."""
        return self._jobs

    def run(self, tasks: Iterable[Callable[[], R]]) -> Iterator[R | None]:
        """Yields the results of the tasks as they end, in any order; None each second without a result.

        Tasks are taken when there is a worker for them. They can be pickled, as `functools.partial` objects can.

        Raises:
            LostWorkerError: if a worker has died. The tasks that had not ended may be run again.
            OSError: if a cluster does not answer, or is lost.
            Exception: what a task raises.
        """
        waiting: set[Future[R]] = set()
        remaining = iter(tasks)
        limit = 2 * self.workers
        try:
            while True:
                while len(waiting) < limit and (task := next(remaining, None)) is not None:
                    waiting.add(self._submit(task))
                if not waiting:
                    return
                done, waiting = wait(waiting, WATCH_PERIOD, FIRST_COMPLETED)
                if not done:
                    self._look()
                    yield None
                for future in done:
                    yield self._result(future)
        finally:
            if waiting:
                self._abandon(waiting)

    def _submit(self, task: Callable[[], R]) -> Future[R]:
        """Begins a task."""
        future: Future[R] = self._executor().submit(call, task)
        return future

    def _executor(self) -> Any:
        # Drake 1.51 keeps every diagram with Python systems alive, 2 MB each; loky replaces processes that have grown.
        warnings.filterwarnings("ignore", message="A worker stopped while some jobs", category=UserWarning)
        return get_reusable_executor(
            self._jobs, timeout=IDLE_TIME, initializer=watch_parent, initargs=(os.getpid(),), env=ONE_THREAD
        )

    def _look(self) -> None:
        """Is called when there was no result for a while."""

    def _result(self, future: Future[R]) -> R:
        """Returns the result of a task that has ended, or raises what `run` does."""
        try:
            return future.result()
        except Exception as error:
            if any(kind.__name__ in LOSSES for kind in type(error).__mro__):
                raise LostWorkerError(str(error)) from error
            raise

    def _abandon(self, waiting: set[Future[R]]) -> None:
        """Ends tasks whose results nobody waits for any more."""
        executor = self._executor()
        # Loky forgets the tasks when it kills the workers, and then looks for those whose numbers are still queued.
        with contextlib.suppress(queue.Empty):
            while True:
                executor._work_ids.get_nowait()
        executor.shutdown(kill_workers=True)


def run_in_processes(tasks: Iterable[Callable[[], R]], *, jobs: int) -> Iterator[R]:
    """Yields the results of the tasks in their order, as they finish, from at most ``jobs`` processes.

    Args:
        tasks: functions without arguments that can be pickled, for example `functools.partial` objects.
        jobs: number of processes; 1 runs the tasks in this process.
    """
    if jobs == 1:
        yield from (task() for task in tasks)
        return
    ended: dict[int, R] = {}
    number = 0  # of the next result
    for done in WorkerPool(jobs).run(partial(numbered, k, task) for k, task in enumerate(tasks)):
        if done is not None:
            ended[done[0]] = done[1]
        while number in ended:
            yield ended.pop(number)
            number += 1


def received(value: R) -> R:
    """Returns what another process receives of a value; raises what pickling it raises, whatever that is."""
    found: R = loads(dumps(value))
    return found


def call(task: Callable[[], R]) -> R:
    """Returns the result of a task, in a worker."""
    return task()


def numbered(number: int, task: Callable[[], R]) -> tuple[int, R]:
    """Returns the number and the result of a task, in a worker."""
    return number, task()


def watch_parent(parent: int) -> None:
    """Starts a thread that ends this process at most `WATCH_PERIOD` after the process ``parent`` has ended.

    Ctrl-C reaches all processes of a terminal; only the parent acts on it, and ends its workers.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:  # a process without a parent gets another one
        time.sleep(WATCH_PERIOD)
    os._exit(1)  # at once: nobody is left to take the result
