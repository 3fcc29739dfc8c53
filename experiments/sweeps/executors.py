"""Where the tasks of a sweep run: in processes of this machine, on a Dask cluster or on a Ray cluster."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from concurrent.futures import CancelledError, Future
from contextlib import ExitStack, suppress
from typing import Any, TypeVar

from experiments.worker_pool import WorkerPool, call

R = TypeVar("R")

LOCAL, DASK, RAY = "local", "dask", "ray"

CONNECT_TIME = 20.0
"""Time to wait for a scheduler and its first worker, s."""

PATIENCE = 10.0
"""Time without a worker after which the user is told, s."""


def make_pool(
    backend: str, *, jobs: int, address: str | None = None, tell: Callable[[str], None] = lambda _: None
) -> WorkerPool:
    """Returns a pool of workers, which connects to its cluster when that is needed.

    Args:
        backend: `LOCAL`, `DASK` or `RAY`.
        jobs: number of processes that are started; a cluster that runs already has its own.
        address: of a running cluster; None starts one on this machine.
        tell: is called with what the user should know while the tasks wait.
    """
    if backend == DASK:
        return DaskPool(jobs, address, tell)
    return RayPool(jobs, address) if backend == RAY else WorkerPool(jobs)


class ClusterPool(WorkerPool):
    """A pool of workers that another program starts; see `make_pool`.

    Raises:
        ModuleNotFoundError: by `run` and `workers`, if the back end is not installed.
        OSError: likewise, if the cluster does not answer.
    """

    def __init__(self, jobs: int, address: str | None) -> None:
        super().__init__(jobs)
        self._address = address
        self._stack = ExitStack()
        self._is_connected = False

    def __exit__(self, *_: object) -> None:
        """Ends the connection, and a cluster that was started here."""
        self._stack.close()
        self._is_connected = False

    @property
    def workers(self) -> int:
        """Number of tasks that run at the same time."""
        if not self._is_connected:
            self._connect()
            self._is_connected = True
        return self._jobs

    def _connect(self) -> None:
        """Connects to the cluster, or starts it, and counts its workers."""

    def _abandon(self, waiting: set[Future[R]]) -> None:
        for future in waiting:
            future.cancel()


class DaskPool(ClusterPool):
    """Workers of a Dask cluster, which sends the tasks of a worker that dies to others."""

    def __init__(self, jobs: int, address: str | None, tell: Callable[[str], None]) -> None:
        super().__init__(jobs, address)
        self._tell = tell
        self._place = "--executor dask" if address is None else f"--address {address}"
        self._without_worker: float | None = None  # since when
        self._is_told = False

    def _connect(self) -> None:
        import distributed

        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # the errors that it logs are raised too
        make_client: Any = distributed.Client
        make_cluster: Any = distributed.LocalCluster
        if self._address is None:
            # On this machine only, with one thread for each process: the simulation holds the interpreter.
            cluster = make_cluster(n_workers=self._jobs, threads_per_worker=1, dashboard_address=":0", host="127.0.0.1")
            self._client = self._stack.enter_context(make_client(self._stack.enter_context(cluster)))
        else:
            self._connect_to_running(make_client)
        self._futures = self._client.get_executor(pure=False)
        self._jobs = max(1, sum(self._client.ncores().values()))

    def _connect_to_running(self, make_client: Any) -> None:
        try:
            self._client = self._stack.enter_context(make_client(self._address, timeout=CONNECT_TIME))
            self._client.wait_for_workers(1, timeout=CONNECT_TIME)
            threads = max(self._client.nthreads().values())
        except TimeoutError as error:
            raise OSError(f"{self._place}: the Dask scheduler has no worker") from error
        except (OSError, ValueError) as error:
            raise OSError(f"{self._place}: no Dask scheduler answers there ({error})") from error
        if threads > 1:  # they would share the interpreter, which the simulation holds
            reason = f"a Dask worker has {threads} threads; start workers with --nthreads 1, one for each core"
            raise OSError(f"{self._place}: {reason}")

    def _submit(self, task: Callable[[], R]) -> Future[R]:
        future: Future[R] = self._futures.submit(call, task)
        return future

    def _result(self, future: Future[R]) -> R:
        try:
            return super()._result(future)
        except CancelledError as error:  # so Dask tells it
            reason = "the connection to the Dask scheduler is lost; the same command goes on"
            raise OSError(f"{self._place}: {reason}") from error

    def _look(self) -> None:
        """Tells once when there has been no worker for a while, and when there is one again."""
        with suppress(OSError):  # if the scheduler is lost, the tasks end
            number = len(self._client.ncores())
            if number:
                if self._is_told:
                    self._tell(f"{self._place}: workers: {number}")
                self._without_worker, self._is_told = None, False
                return
        now = time.monotonic()
        if self._without_worker is None:
            self._without_worker = now
        if not self._is_told and now - self._without_worker >= PATIENCE:
            self._tell(f"{self._place}: the Dask scheduler has no worker; the sweep waits for one (Ctrl-C ends it)")
            self._is_told = True


class RayPool(ClusterPool):
    """Workers of a Ray cluster."""

    def _connect(self) -> None:
        import ray

        quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": logging.ERROR}
        try:
            if self._address is None:
                ray.init(num_cpus=self._jobs, include_dashboard=False, **quiet)
            else:
                ray.init(address=self._address, **quiet)
        except (ConnectionError, OSError, ValueError, RuntimeError) as error:
            reason = "Ray does not start" if self._address is None else f"--address {self._address}: no Ray cluster"
            raise OSError(f"{reason} ({error})") from error
        self._stack.callback(ray.shutdown)
        if self._address is not None:
            resources: Any = ray.cluster_resources
            self._jobs = int(resources().get("CPU", 1))
        make_remote: Any = ray.remote(max_retries=0)
        self._remote = make_remote(call)

    def _submit(self, task: Callable[[], R]) -> Future[R]:
        future: Future[R] = self._remote.remote(task).future()
        return future

    def _result(self, future: Future[R]) -> R:
        try:
            return super()._result(future)
        except Exception as error:
            raise getattr(error, "cause", None) or error from error  # Ray wraps what a task raises, with its traceback
