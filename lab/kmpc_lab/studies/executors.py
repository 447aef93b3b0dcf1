"""What runs a study: processes of this machine, or a Dask cluster.

Every task is a function of its arguments alone, so that rows are the same to the last bit
whatever runs them (but for the step times in them, which a clock measures). A worker that is
killed loses nothing: what it was at runs again elsewhere.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

from kmpc_lite.errors import KmpcError

TRIES = 3
"""How often a task may lose its worker before it is taken for the cause; Dask's own default."""
ANSWER = 10.0
"""How long a cluster may take to answer, and to have a worker [s]."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class WorkerLost(KmpcError):
    """A task's worker process ended several times: it was killed, or out of memory."""


@contextmanager
def executor(workers: int | None = None, cluster: str | None = None) -> Iterator[Executor]:
    """Start what runs a study.

    Parameters
    ----------
    workers : int, optional
        Processes on this machine; as many as it has cores if not given.
    cluster : str, optional
        Address of a Dask scheduler (``tcp://host:8786``), which then does the work instead.

    Yields
    ------
    Executor
        An interrupt, or any error, ends its work at once.

    Raises
    ------
    KmpcError
        If Dask is not installed, no scheduler answers, it has no workers, or these have
        another version of this package.
    """
    if cluster is not None:
        with _cluster(cluster) as remote:
            yield remote
        return
    local = Processes(workers or os.cpu_count() or 1)
    try:
        yield local
    except BaseException:
        local.terminate()
        raise
    local.shutdown()


def gather(jobs: Mapping[Future[Any], Callable[[Any], None]]) -> None:
    """Hand every result over as it comes.

    What else is being driven is kept before the first worker's error ends the study.

    Parameters
    ----------
    jobs : mapping
        What takes the result, by the future that gives it.
    """
    first_error: BaseException | None = None
    for job in as_completed(jobs):
        if (error := job.exception()) is not None:
            first_error = first_error or error
        else:
            jobs[job](job.result())
    if first_error is not None:
        raise first_error


@dataclass
class _Task:
    """A call, and the future that a caller waits for."""

    call: Callable[[], Any]
    future: Future[Any]
    tries: int = TRIES


class Processes(Executor):
    """Fresh processes, which load NumPy with one thread each; tasks of a killed one run again.

    A `ProcessPoolExecutor` gives up for good when a process dies. This one starts another pool,
    and hands it no more tasks at a time than it has processes: only what ran beside the process
    that died is counted as having lost its worker.

    Parameters
    ----------
    workers : int
        Processes.
    """

    def __init__(self, workers: int) -> None:
        self._workers = workers
        self._lock = threading.RLock()
        self._waiting: deque[_Task] = deque()
        self._running = 0
        self._futures: set[Future[Any]] = set()
        self._open, self._ended = True, False
        self._pool = self._new_pool()

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run a function in a process, as `concurrent.futures.Executor.submit` says."""
        task = _Task(partial(fn, *args, **kwargs), Future())
        with self._lock:
            if not self._open:
                raise RuntimeError("cannot submit after shutdown")
            self._waiting.append(task)
            self._futures.add(task.future)
        task.future.add_done_callback(self._futures.discard)
        self._fill()
        return task.future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes when what was submitted is done, or cancelled."""
        with self._lock:
            self._open, self._ended = False, self._ended or cancel_futures
            futures = list(self._futures)
        if cancel_futures:
            for future in futures:
                future.cancel()
        elif wait:
            for _ in as_completed(futures):
                pass
        self._pool.shutdown(wait, cancel_futures=cancel_futures)

    def terminate(self) -> None:
        """End the processes at once, whatever they are at."""
        with self._lock:
            self._open, self._ended = False, True
            processes = list((self._pool._processes or {}).values())
        for process in processes:
            process.terminate()
        self.shutdown(wait=False, cancel_futures=True)

    def _new_pool(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self._workers, mp_context=multiprocessing.get_context("spawn"))

    def _fill(self) -> None:
        """Hand tasks to idle processes."""
        with self._lock:
            while self._waiting and self._running < self._workers:
                task = self._waiting.popleft()
                if not task.future.running() and not task.future.set_running_or_notify_cancel():
                    continue
                self._running += 1
                self._start(task)

    def _start(self, task: _Task) -> None:
        with _quiet_children():
            try:
                inner = self._pool.submit(task.call)
            except BrokenProcessPool:  # noticed before the futures of this pool have failed
                self._pool = self._new_pool()
                inner = self._pool.submit(task.call)
        inner.add_done_callback(partial(self._finish, task, self._pool))

    def _finish(self, task: _Task, pool: ProcessPoolExecutor, inner: Future[Any]) -> None:
        """Pass a result on; what lost its process waits for another."""
        error = None if inner.cancelled() else inner.exception()
        with self._lock:
            self._running -= 1
            if isinstance(error, BrokenProcessPool) and self._pool is pool:
                self._pool = self._new_pool()
            task.tries -= isinstance(error, BrokenProcessPool)
            again = isinstance(error, BrokenProcessPool) and task.tries > 0 and not self._ended
            if again:
                self._waiting.appendleft(task)
        if inner.cancelled():
            task.future.set_exception(KmpcError("the study was ended"))
        elif isinstance(error, BrokenProcessPool) and not again:
            lost = WorkerLost(f"a worker process ended {TRIES} times at the same task: {error}")
            task.future.set_exception(lost)
        elif error is not None and not again:
            task.future.set_exception(error)
        elif not again:
            task.future.set_result(inner.result())
        self._fill()


@contextmanager
def _quiet_children() -> Iterator[None]:
    """Let processes that start here inherit one thread for linear algebra, and no Ctrl-C.

    A terminal sends Ctrl-C to the workers, too: they inherit that it is blocked, and leave it to
    this process.
    """
    before = {name: os.environ.get(name) for name in THREADS}
    unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    """Connect to a Dask scheduler; it runs the tasks of a lost worker elsewhere by itself."""
    try:
        from distributed import Client
    except ImportError as error:
        raise KmpcError(
            "--cluster: Dask is not installed: pip install 'kmpc-lab[cluster]'"
        ) from error
    try:
        client = Client(address, timeout=ANSWER, set_as_default=False)
    except (OSError, ValueError) as error:
        raise KmpcError(
            f"--cluster {address}: no Dask scheduler answers within {ANSWER:g} s: {error}"
        ) from error
    try:
        _check_workers(client, address)
        remote = client.get_executor(pure=False)
        try:
            yield remote
        except BaseException:
            remote.shutdown(wait=False)
            raise
        remote.shutdown()
    finally:
        client.close()


def _check_workers(client: Any, address: str) -> None:
    """Raise KmpcError unless there are workers that have this very version."""
    try:
        client.wait_for_workers(1, timeout=ANSWER)
    except TimeoutError as error:
        raise KmpcError(
            f"--cluster {address}: no worker within {ANSWER:g} s: start dask worker {address}"
        ) from error
    here = version()
    for worker, there in client.run(version, on_error="return").items():
        if there != here:
            raise KmpcError(
                f"--cluster {address}: worker {worker} has kmpc_lite {there}, expected {here}"
            )


def version() -> str:
    """Version of this package where it is called."""
    from kmpc_lite import __version__

    return __version__
