"""Several studies that take the same options, as one command each."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping
from functools import partial

from kmpc_lite.cli.command import Command
from kmpc_lite.errors import ScenarioError


def named(
    studies: Mapping[str, str],
    add_options: Callable[[argparse.ArgumentParser], None],
    run: Callable[[argparse.Namespace, str], int],
) -> dict[str, Command]:
    """Make a command of each study.

    Parameters
    ----------
    studies : mapping
        Name and text of each.
    add_options : callable
        Adds the options of all of them.
    run : callable
        Runs the one whose name it is given.
    """
    return {
        name: Command(
            text=text,
            examples=(f"kmpc study {name} --drives 10", f"kmpc study {name} --json > {name}.json"),
            add_options=add_options,
            run=partial(_run, run, name),
        )
        for name, text in studies.items()
    }


def _run(
    run: Callable[[argparse.Namespace, str], int], name: str, options: argparse.Namespace
) -> int:
    return run(options, name)


def chosen(names: Iterable[str], words: Iterable[str] | None, option: str = "--only") -> list[str]:
    """Names that hold one of the words; all of them where no word is given.

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
