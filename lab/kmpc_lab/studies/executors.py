"""What runs a study: joblib, in processes of this machine or on a Dask cluster."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky.process_executor import TerminatedWorkerError

from kmpc_lite import __version__
from kmpc_lite.errors import KmpcError

ANSWER = 10.0
"""How long a cluster may take to answer, and to have a worker [s]."""
Run = Callable[[Callable[..., Any], Iterable[tuple[Any, ...]]], Iterator[Any]]
"""Calls a function with each tuple of arguments; gives what it returns, as it comes."""


@contextmanager
def executor(workers: int | None = None, cluster: str | None = None) -> Iterator[Run]:
    """Start what runs a study.

    `workers`: processes on this machine; as many as it has cores if not given. `cluster`: address
    of a Dask scheduler (``tcp://host:8786``), which then does the work instead. An interrupt, or
    any error, ends its work at once. Raises KmpcError if Dask is not installed, no scheduler
    answers, it has no workers, or these have another version of this package; inside the block, if
    a worker is lost.
    """
    if cluster is None:
        with parallel_config("loky", inner_max_num_threads=1):
            yield _run(workers or -1)
        return
    with _client(cluster) as client, parallel_config("dask"):
        _check_workers(client, cluster)
        yield _run(-1)


def _run(workers: int) -> Run:
    def run(what: Callable[..., Any], each: Iterable[tuple[Any, ...]]) -> Iterator[Any]:
        parallel = Parallel(workers, return_as="generator_unordered", batch_size=1)
        try:
            yield from parallel(delayed(what)(*some) for some in each)
        except TerminatedWorkerError as error:
            raise KmpcError(
                "a worker process was killed, or ran out of memory: with --records rows that are "
                "done are kept, and --resume goes on; perhaps with fewer --workers"
            ) from error

    return run


def _client(address: str) -> Any:
    """Connect to a Dask scheduler."""
    try:
        from distributed import Client
    except ImportError as error:
        raise KmpcError(
            "--cluster: Dask is not installed: pip install 'kmpc-lab[cluster]'"
        ) from error
    try:
        return Client(address, timeout=ANSWER)
    except (OSError, ValueError) as error:
        raise KmpcError(
            f"--cluster {address}: no Dask scheduler answers within {ANSWER:g} s: {error}"
        ) from error


def _check_workers(client: Any, address: str) -> None:
    """Raise KmpcError unless there are workers that have this very version."""
    try:
        client.wait_for_workers(1, timeout=ANSWER)
    except TimeoutError as error:
        raise KmpcError(
            f"--cluster {address}: no worker within {ANSWER:g} s: start dask worker {address}"
        ) from error
    for worker, there in client.run(version, on_error="return").items():
        if there != __version__:
            raise KmpcError(
                f"--cluster {address}: worker {worker} has kmpc_lite {there}, "
                f"expected {__version__}"
            )


def version() -> str:
    """Version of this package where it is called."""
    return __version__
