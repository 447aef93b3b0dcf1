"""Options of a command line that say what runs a study, and where its records stand."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from pathlib import Path

from kmpc_lab.studies.executors import executor
from kmpc_lab.studies.records import check_resume


def add_runner(parser: argparse.ArgumentParser) -> None:
    """Add the options that `runner` reads."""
    add = parser.add_argument
    add("--workers", type=_count, metavar="N", help="processes (default: all cores)")
    add(
        "--cluster",
        metavar="ADDRESS",
        help="Dask scheduler that does the work instead: tcp://HOST:8786 (extra cluster)",
    )
    add(
        "--records",
        type=Path,
        metavar="FILE",
        help="where each result is added as soon as it is there (.jsonl)",
    )
    add("--resume", action="store_true", help="go on from what the records file holds")


@contextmanager
def runner(options: argparse.Namespace) -> Iterator[Executor]:
    """Start what the options ask for; what contradicts itself is told before.

    Raises
    ------
    KmpcError
        For records that would be added to by mistake, or a cluster that cannot be used.
    """
    check_resume(options.records, options.resume)
    with executor(options.workers, options.cluster) as started:
        yield started


def _count(text: str) -> int:
    """Read a whole number from 1 up."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise argparse.ArgumentTypeError(f"expected a whole number >= 1, got {text!r}")
    return value
