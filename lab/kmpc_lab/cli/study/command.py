"""A study as a command: options that studies share, what runs it, and how its result is said."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from kmpc_lite.cli.command import Command
from kmpc_lite.cli.numbers import count
from kmpc_lite.cli.progress import ProgressBar
from kmpc_lite.errors import ScenarioError

if TYPE_CHECKING:
    from kmpc_lab.studies.records import Work

Job = Callable[[argparse.Namespace, "Work"], tuple[Any, str, bool]]
"""What a study does with its options: its result for machines, the same for people, and whether
something happened that must not."""


def study(
    name: str,
    text: str,
    add_options: Callable[[argparse.ArgumentParser], None],
    job: Job,
    examples: tuple[str, ...] = (),
) -> Command:
    """Make the command of a study.

    Parameters
    ----------
    name, text : str
        Of the study.
    add_options : callable
        Adds the study's own options to those that say what runs it.
    job : callable
        See `Job`; status 1 if something happened that must not.
    examples : tuple of str
        Command lines; two of ``--drives`` and ``--json`` if none are given.
    """
    usual = f"kmpc study {name} --drives 10", f"kmpc study {name} --json > {name}.json"

    def add(parser: argparse.ArgumentParser) -> None:
        add_options(parser)
        _add_work(parser)

    def run(options: argparse.Namespace) -> int:
        from kmpc_lab.studies.executors import executor
        from kmpc_lab.studies.records import Work, check_resume

        check_resume(options.records, options.resume)
        bar = ProgressBar(name, quiet=options.json)
        with executor(options.workers, options.cluster) as started:
            told, words, bad = job(options, Work(started, bar, options.records))
        print(json.dumps(told) if options.json else words)
        return int(bad)

    return Command(text=text, examples=examples or usual, add_options=add, run=run)


def _add_work(parser: argparse.ArgumentParser) -> None:
    """Add what runs a study, and where its records stand."""
    add = parser.add_argument
    add("--workers", type=count, metavar="N", help="processes (default: all cores)")
    add(
        "--cluster",
        metavar="ADDRESS",
        help="Dask scheduler that runs the drives: tcp://HOST:8786 (extra cluster)",
    )
    add(
        "--records",
        type=Path,
        metavar="FILE",
        help="file to which each result is added at once (.jsonl)",
    )
    add("--resume", action="store_true", help="continue from the results in the records file")


def add_slips(parser: argparse.ArgumentParser) -> None:
    """Add which floors are driven on, and `add_tuning`."""
    add = parser.add_argument
    add(
        "--slips",
        type=float,
        nargs="+",
        metavar="SLIP",
        help="mean slip ratios (default: the study's)",
    )
    add_tuning(parser)


def add_tuning(parser: argparse.ArgumentParser) -> None:
    """Add which seeds are driven: what `first_seed` reads."""
    words = "use the tuning seeds instead of the reporting ones"
    parser.add_argument("--tuning", action="store_true", help=words)


def first_seed(options: argparse.Namespace) -> int:
    """Seed of the first drive; anything is tuned below the reporting ones."""
    from kmpc_lab.studies.training import REPORTING_SEED

    return 0 if options.tuning else REPORTING_SEED


def chosen(names: Iterable[str], words: Iterable[str] | None, option: str = "--only") -> list[str]:
    """Names that hold one of the words; all of them if no word is given.

    Raises
    ------
    ScenarioError
        For a word that no name holds.
    """
    known, asked = list(names), list(words or [""])
    for word in asked:
        if not any(word in name for name in known):
            among = "; ".join(known)
            raise ScenarioError(f"{option}: expected a part of one of {among}; got {word!r}")
    return [name for name in known if any(word in name for word in asked)]
