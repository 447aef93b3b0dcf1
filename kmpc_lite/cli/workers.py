"""Worker processes of the studies."""

from __future__ import annotations

import argparse
import multiprocessing
import os
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager

from kmpc_lite.cli.numbers import count


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Add the options that say what runs a study."""
    parser.add_argument(
        "--workers",
        type=count,
        default=os.cpu_count() or 1,
        metavar="N",
        help="processes (default: all cores)",
    )


@contextmanager
def worker_pool(workers: int) -> Iterator[Executor]:
    """Start fresh processes, which load NumPy with one thread each.

    An interrupt ends them at once.
    """
    pool = ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn"))
    # a terminal sends Ctrl-C to the workers too: they inherit that it is blocked, and leave it to
    # this process
    unblocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        for _ in range(workers):
            pool.submit(os.getpid)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, unblocked)
    try:
        yield pool
    except BaseException:
        for process in multiprocessing.active_children():
            process.terminate()
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    pool.shutdown()
