"""Runs tasks on joblib's back ends: processes of this machine, a Dask cluster or a Ray cluster."""

from __future__ import annotations

import logging
import os
import queue
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager, ExitStack, suppress
from typing import Any, TypeVar

from joblib import Parallel, delayed, parallel_config

from experiments.worker_pool import call, ignore_replaced_workers, watch_parent

R = TypeVar("R")

LOCAL, DASK, RAY = "local", "dask", "ray"
BACKENDS = (LOCAL, DASK, RAY)

WAITING = 256
"""Results that wait for the caller at most."""

LOOK_PERIOD = 1.0
"""Time between two looks for workers that have died, s."""


CONNECT_TIME = 20.0
"""Time to wait for a scheduler and its first worker, s."""


END_TIME = 20.0
"""Time to wait for the end of the tasks under way, s."""

PATIENCE = 10.0
"""Time without a worker after which the user is told, s."""


class LostWorkerError(RuntimeError):
    """Worker processes have ended, and with them the tasks that they had begun."""


class Executor:
    """Runs tasks in the processes of a back end, to which it connects for the first task; a context manager.

    Args:
        backend: one of ``BACKENDS``.
        jobs: number of processes that are started; a cluster that runs already has its own.
        address: of a running cluster; None starts one on this machine.
        tell: is called with what the user should know while the tasks wait.
    """

    def __init__(
        self, backend: str, *, jobs: int, address: str | None = None, tell: Callable[[str], None] = lambda _: None
    ) -> None:
        self.backend, self.jobs, self.address, self._tell = backend, jobs, address, tell
        self._without_worker: float | None = None  # since when
        self._is_told = False
        self._stack = ExitStack()
        self._client: Any = None
        self._is_connected = False

    def __enter__(self) -> Executor:
        """Does nothing yet."""
        return self

    def __exit__(self, *_: object) -> None:
        """Ends the connection, and a cluster that was started here."""
        self.disconnect()

    def disconnect(self) -> None:
        """Ends the connection, and a cluster that was started here; the next task makes a new one."""
        self._stack.close()
        self._is_connected = False

    @property
    def workers(self) -> int:
        """Number of tasks that run at the same time."""
        if self.address is None:
            return self.jobs
        self._connect()
        return sum(self._client.ncores().values()) if self.backend == DASK else self.jobs

    def _connect(self) -> None:
        """Connects to the cluster, or starts it.

        Raises:
            ModuleNotFoundError: if the back end is not installed.
            OSError: if the cluster does not answer.
        """
        if not self._is_connected:
            if self.backend == DASK:
                self._connect_dask()
            elif self.backend == RAY:
                self._connect_ray()
            self._is_connected = True

    def run(self, tasks: Iterable[Callable[[], R]]) -> Iterator[R | None]:
        """Yields the results of the tasks as they end, in any order; None each second without a result.

        Tasks are taken when there is a worker for them, in another thread.

        Raises:
            LostWorkerError: if workers have died. The tasks that had not ended may be run again.
            ModuleNotFoundError: if the back end is not installed.
            OSError: if the cluster does not answer, or its scheduler is lost.
            Exception: what a task raises.
        """
        self._connect()
        results: queue.Queue[tuple[R | None, BaseException | None] | None] = queue.Queue(WAITING)
        stopped = threading.Event()

        def put(item: tuple[R | None, BaseException | None] | None) -> None:
            while not stopped.is_set():
                with suppress(queue.Full):
                    results.put(item, timeout=LOOK_PERIOD)
                    return

        def calls() -> Iterator[Any]:
            for task in tasks:
                if stopped.is_set():
                    return
                yield delayed(call)(task)

        def consume() -> None:
            try:
                with self._configured():
                    for result in Parallel(**self._settings())(calls()):
                        put((result, None))
                        if stopped.is_set():
                            return
                put(None)
            except BaseException as error:
                put((None, error))

        thread = threading.Thread(target=consume, name="tasks", daemon=True)
        thread.start()
        try:
            while True:
                try:
                    item = results.get(timeout=LOOK_PERIOD)
                except queue.Empty:
                    self._check_cluster()
                    yield None
                    continue
                if item is None:
                    return
                result, error = item
                if error is not None and _is_loss(error):
                    raise LostWorkerError(str(error)) from error
                if isinstance(error, CancelledError):  # so Dask tells it
                    reason = "the connection to the Dask scheduler is lost; the same command goes on"
                    raise OSError(f"{self._place}: {reason}") from error
                if error is not None:
                    raise error
                yield result
        finally:
            stopped.set()
            if self.backend == LOCAL:  # joblib ends its processes after the next result
                thread.join(END_TIME)

    def _settings(self) -> dict[str, Any]:
        """Arguments of `Parallel`."""
        settings: dict[str, Any] = {"return_as": "generator_unordered", "batch_size": 1}
        if self.backend == LOCAL:
            ignore_replaced_workers()
            settings |= {"n_jobs": self.jobs, "max_nbytes": None}
            settings |= {"initializer": watch_parent, "initargs": (os.getpid(),)}
        # Joblib would run the tasks of a single process in this one, which nothing replaces: of two, one works.
        if self.backend != DASK and self.jobs == 1:
            settings |= {"n_jobs": 2, "pre_dispatch": 1}
        return settings

    def _configured(self) -> AbstractContextManager[Any]:
        """The back end, for joblib."""
        if self.backend == LOCAL:
            return ExitStack()
        chosen: AbstractContextManager[Any] = (
            parallel_config(backend=_PLURAL_DASK, client=self._client)
            if self.backend == DASK
            else parallel_config(backend=_STREAMING_RAY, n_jobs=max(2, self.jobs))
        )
        return chosen

    @property
    def _place(self) -> str:
        return "--engine dask" if self.address is None else f"--address {self.address}"

    def _check_cluster(self) -> None:
        """Tells when a Dask cluster has no worker, and raises if one of its tasks has killed several of them.

        Raises:
            LostWorkerError: if Dask has given up a task; joblib would wait for it for ever.
        """
        if self.backend != DASK:
            return
        if any(future.status == "error" for future in list(self._client.futures.values())):
            self.disconnect()
            raise LostWorkerError("several workers died while they ran the same task")
        with suppress(OSError):  # if the scheduler is lost, the tasks end
            self._note_workers(len(self._client.ncores()))

    def _note_workers(self, number: int) -> None:
        """Tells once when there has been no worker for a while, and when there is one again."""
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

    def _connect_dask(self) -> None:
        import distributed
        from joblib import register_parallel_backend
        from joblib._dask import DaskDistributedBackend

        class PluralDask(DaskDistributedBackend):  # type: ignore[misc]
            """Dask's back end; with a single worker joblib would run the tasks in this process."""

            def effective_n_jobs(self, n_jobs: int) -> int:
                """Number of tasks that are sent at first, over two."""
                return max(2, int(super().effective_n_jobs(n_jobs)))

        register_parallel_backend(_PLURAL_DASK, PluralDask)
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # the errors that it logs are raised too
        make_client: Any = distributed.Client
        make_cluster: Any = distributed.LocalCluster

        if self.address is None:
            # On this machine only, with one thread for each process: the simulation holds the interpreter.
            cluster = make_cluster(n_workers=self.jobs, threads_per_worker=1, dashboard_address=":0", host="127.0.0.1")
            self._client = self._stack.enter_context(make_client(self._stack.enter_context(cluster)))
            return
        try:
            self._client = self._stack.enter_context(make_client(self.address, timeout=CONNECT_TIME))
            self._client.wait_for_workers(1, timeout=CONNECT_TIME)
            threads = max(self._client.nthreads().values())
        except TimeoutError as error:
            raise OSError(f"{self._place}: the Dask scheduler has no worker") from error
        except (OSError, ValueError) as error:
            raise OSError(f"{self._place}: no Dask scheduler answers there ({error})") from error
        if threads > 1:  # they would share the interpreter, which the simulation holds
            reason = f"a Dask worker has {threads} threads; start workers with --nthreads 1, one for each core"
            raise OSError(f"{self._place}: {reason}")

    def _connect_ray(self) -> None:
        import ray
        from joblib import register_parallel_backend
        from ray.util.joblib.ray_backend import RayBackend

        class StreamingRay(RayBackend):  # type: ignore[misc]
            """Ray's back end; its pool can return results as they end, which joblib allows no pool by default."""

            supports_return_generator = True

        register_parallel_backend(_STREAMING_RAY, StreamingRay)
        try:
            if self.address is None:
                ray.init(
                    num_cpus=max(2, self.jobs),
                    include_dashboard=False,
                    log_to_driver=False,
                    logging_level=logging.ERROR,
                )
            else:
                ray.init(address=self.address, log_to_driver=False, logging_level=logging.ERROR)
        except (ConnectionError, OSError, ValueError, RuntimeError) as error:
            what = "Ray does not start" if self.address is None else f"--address {self.address}: no Ray cluster answers"
            raise OSError(f"{what} ({error})") from error
        self._stack.callback(ray.shutdown)
        if self.address is not None:
            resources: Any = ray.cluster_resources
            self.jobs = int(resources().get("CPU", 1))


_STREAMING_RAY, _PLURAL_DASK = "haptic-skill-ray", "haptic-skill-dask"
"""Names of back ends, for joblib."""

LOSSES = {"TerminatedWorkerError", "BrokenProcessPool", "KilledWorker", "ActorDiedError", "WorkerCrashedError"}
"""Names of the exceptions by which joblib, Dask and Ray tell that a worker has died."""


def _is_loss(error: BaseException) -> bool:
    return any(kind.__name__ in LOSSES for kind in type(error).__mro__)
