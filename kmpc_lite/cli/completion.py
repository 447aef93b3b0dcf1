"""`kmpc completion`: let the shell complete commands, options and their choices."""

from __future__ import annotations

import argparse
from pathlib import Path

from kmpc_lite.cli.command import Command, build_parser, known_commands
from kmpc_lite.cli.extras import need

SHELLS = ("bash", "zsh", "tcsh")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    parser.add_argument("shell", choices=SHELLS, help="whose completion to print")


def run(options: argparse.Namespace) -> int:
    """Print the script that the shell reads."""
    need("completion", "shtab")
    import json

    import shtab

    parser = build_parser(known_commands())
    _complete_files(parser, shtab.FILE)
    script = shtab.complete(parser, shell=options.shell)
    print(json.dumps({"shell": options.shell, "script": script}) if options.json else script)
    return 0


def _complete_files(parser: argparse.ArgumentParser, mark: object) -> None:
    """Mark the options that take files or folders, so that the shell completes their paths."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for below in action.choices.values():
                _complete_files(below, mark)
        elif action.type is Path or action.metavar in ("FILE", "DIR"):
            action.complete = mark  # type: ignore[attr-defined]


COMMAND = Command(
    text="Print a script with which the shell completes kmpc's commands and options.",
    examples=(
        'eval "$(kmpc completion bash)"        # put this line into ~/.bashrc',
        "kmpc completion zsh > ~/.zsh/completions/_kmpc",
    ),
    add_options=add_options,
    run=run,
)
