"""The processes that simulate: the one place that starts them. They end soon after their parent, however it ends."""

from __future__ import annotations

import os
import signal
import threading
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeVar

from joblib import Parallel, delayed, parallel_config

R = TypeVar("R")

WATCH_PERIOD = 1.0
"""Time between two looks at the parent, s."""

IDLE_TIME = 300
"""Time after which a process without a task ends, s."""

CONNECT_TIME = 20.0
"""Time to wait for a scheduler and its first worker, s."""


class LostWorkerError(RuntimeError):
    """A worker process has died, and with it the tasks that had begun."""


class WorkerPool:
    """Runs tasks in processes; a single process of this machine is this one.

    Args:
        workers: number of tasks that run at the same time.
        backend: of joblib.
        **options: of the backend.
    """

    def __init__(self, workers: int, backend: str = "loky", **options: Any) -> None:
        self.workers = workers
        self._backend, self._options = backend, options

    def run(self, tasks: Iterable[Callable[[], R]], *, in_order: bool = False) -> Iterator[R]:
        """Yields the results of the tasks as they end.

        Tasks are taken when there is a worker for them, perhaps in another thread. They can be pickled, as
        `functools.partial` objects can.

        Raises:
            LostWorkerError: if a worker has died. The tasks that had not ended may be run again.
            OSError: if the connection to a cluster is lost.
            Exception: what a task raises, or the iterator of the tasks.
        """
        raised: list[Exception] = []

        def taken() -> Iterator[Any]:
            try:
                yield from (delayed(task)() for task in tasks)
            except Exception as error:  # joblib would wait for ever
                raised.append(error)

        with parallel_config(backend=self._backend, n_jobs=self.workers, **self._options):
            parallel = Parallel(return_as="generator" if in_order else "generator_unordered", max_nbytes=None)
        try:
            yield from parallel(taken())
        except CancelledError as error:
            raise OSError("the connection to the Dask scheduler is lost; the same command goes on") from error
        except Exception as error:
            if isinstance(error, BrokenProcessPool) or type(error).__name__ == "KilledWorker":  # loky's, Dask's
                raise LostWorkerError(str(error)) from error
            raise
        if raised:
            raise raised[0]


def local_pool(jobs: int) -> WorkerPool:
    """Returns a pool of processes of this machine, with one thread each, which are started for the first task."""
    # Drake 1.51 keeps every diagram with Python systems alive, 2 MB each; loky replaces processes that have grown.
    warnings.filterwarnings(
        "ignore", message=r"A worker stopped|\d+ tasks (have been|which were)", category=UserWarning
    )
    if jobs == 1:
        return WorkerPool(1, "sequential")
    return WorkerPool(
        jobs,
        inner_max_num_threads=1,
        idle_worker_timeout=IDLE_TIME,
        initializer=watch_parent,
        initargs=(os.getpid(),),
    )


@contextmanager
def dask_pool(address: str) -> Iterator[WorkerPool]:
    """Connects to a Dask scheduler and gives the pool of its workers; Dask sends the tasks of one that dies to others.

    Raises:
        ModuleNotFoundError: if Dask is not installed.
        OSError: if the scheduler does not answer, has no worker, or one that runs several tasks at the same time.
    """
    import distributed

    make_client: Any = distributed.Client
    try:
        client = make_client(address, timeout=CONNECT_TIME)
        client.wait_for_workers(1, timeout=CONNECT_TIME)
    except (OSError, ValueError) as error:
        raise OSError(f"--dask {address}: no Dask scheduler with a worker answers there ({error})") from error
    with client:
        threads = list(client.nthreads().values())
        if max(threads) > 1:  # they would share the interpreter, which the simulation holds
            expected = "start workers with --nthreads 1, one for each core"
            raise OSError(f"--dask {address}: a Dask worker has {max(threads)} threads; {expected}")
        yield WorkerPool(len(threads), "dask")


def run_in_processes(tasks: Iterable[Callable[[], R]], *, jobs: int) -> Iterator[R]:
    """Yields the results of the tasks in their order, as they finish, from at most ``jobs`` processes.

    Args:
        tasks: functions without arguments that can be pickled, for example `functools.partial` objects.
        jobs: number of processes; 1 runs the tasks in this process.
    """
    return local_pool(jobs).run(tasks, in_order=True)


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
