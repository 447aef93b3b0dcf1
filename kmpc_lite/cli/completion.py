"""`kmpc completion`: let the shell complete commands, options and their choices."""

from __future__ import annotations

import argparse

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

    script = shtab.complete(build_parser(known_commands()), shell=options.shell)
    print(json.dumps({"shell": options.shell, "script": script}) if options.json else script)
    return 0


COMMAND = Command(
    text="Print a script with which the shell completes kmpc's commands and options.",
    examples=(
        'eval "$(kmpc completion bash)"        # put this line into ~/.bashrc',
        "kmpc completion zsh > ~/.zsh/completions/_kmpc",
    ),
    add_options=add_options,
    run=run,
)
