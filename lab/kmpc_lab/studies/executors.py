"""What runs a study: processes of this machine, or a Dask cluster.

Rows that are done are in the records, whatever happens to a worker.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeVar

from kmpc_lite.errors import KmpcError

Key = TypeVar("Key")
ANSWER = 10.0
"""How long a cluster may take to answer, and to have a worker [s]."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class WorkerLost(KmpcError):
    """A worker process ended: it was killed, or out of memory."""


@contextmanager
def executor(workers: int | None = None, cluster: str | None = None) -> Iterator[Executor]:
    """Start what runs a study.

    `workers`: processes on this machine; as many as it has cores if not given. `cluster`: address
    of a Dask scheduler (``tcp://host:8786``), which then does the work instead. An interrupt, or
    any error, ends its work at once. Raises KmpcError if Dask is not installed, no scheduler
    answers, it has no workers, or these have another version of this package.
    """
    if cluster is not None:
        with _cluster(cluster) as remote:
            yield remote
        return
    local = ProcessPoolExecutor(
        workers or os.cpu_count() or 1, mp_context=multiprocessing.get_context("spawn")
    )
    with _quiet_children():
        local.submit(int)  # starts them all
    try:
        yield local
    except BaseException:
        for process in list((local._processes or {}).values()):
            process.terminate()
        local.shutdown(wait=False, cancel_futures=True)
        raise
    local.shutdown()


def gather(jobs: Mapping[Future[Any], Key], keep: Callable[[Key, Any], None]) -> None:
    """Hand every result over as it comes, with the key of its future.

    What else is being driven is kept before the first worker's error ends the study.
    """
    first_error: BaseException | None = None
    for job in as_completed(jobs):
        if (error := job.exception()) is not None:
            first_error = first_error or error
        else:
            keep(jobs[job], job.result())
    if isinstance(first_error, BrokenProcessPool):
        raise WorkerLost(
            "a worker process was killed, or ran out of memory: with --records rows that are done "
            "are kept, and --resume goes on; perhaps with fewer --workers"
        ) from first_error
    if first_error is not None:
        raise first_error


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
