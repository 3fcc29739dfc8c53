"""The processes that simulate: the one place that starts them. They end soon after their parent, however it ends."""

from __future__ import annotations

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from joblib import Parallel, delayed

R = TypeVar("R")

WATCH_PERIOD = 1.0  # in units of s, between two looks at the parent


def run_in_processes(tasks: Iterable[Callable[[], R]], *, jobs: int) -> Iterator[R]:
    """Yields the results of the tasks in their order, as they finish, from at most ``jobs`` processes.

    Args:
        tasks: functions without arguments that can be pickled, for example `functools.partial` objects.
        jobs: number of processes; 1 runs the tasks in this process.
    """
    ignore_replaced_workers()
    # Without memory maps (max_nbytes) no temporary folder is left when a process is killed.
    yield from Parallel(
        n_jobs=jobs,
        return_as="generator",
        max_nbytes=None,
        initializer=watch_parent,
        initargs=(os.getpid(),),
    )(delayed(call)(task) for task in tasks)


def ignore_replaced_workers() -> None:
    """Silences the warning of joblib about a process that it replaces because it grew.

    That is as it should be: Drake 1.51 keeps every diagram with Python systems alive, 2 MB each.
    """
    warnings.filterwarnings("ignore", message="A worker stopped while some jobs", category=UserWarning)


def watch_parent(parent: int) -> None:
    """Starts a thread that ends this process at most `WATCH_PERIOD` after the process ``parent`` has ended.

    Ctrl-C reaches all processes of a terminal; only the parent acts on it, and ends its workers.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def call(task: Callable[[], R]) -> R:
    """Returns the result of a task, in a worker."""
    return task()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:  # a process without a parent gets another one
        time.sleep(WATCH_PERIOD)
    os._exit(1)  # at once: nobody is left to take the result
