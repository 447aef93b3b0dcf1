"""`kmpc report`: show a run as one HTML page, or as pictures."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import kmpc_lite as kl
from kmpc_lite.cli.command import Command
from kmpc_lite.cli.extras import need
from kmpc_lite.cli.files import keep_inputs
from kmpc_lite.cli.output import command_line


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("file", type=Path, metavar="run", help="run that kmpc simulate wrote (.npz)")
    add(
        "-o",
        "--output",
        type=Path,
        metavar="FILE",
        help="page to write (default: the run's name with .html)",
    )
    add("--model", type=Path, metavar="FILE", help="model of the run, to show how it was fitted")
    add("--pictures", type=Path, metavar="DIR", help="folder to write PNG pictures to")


def run(options: argparse.Namespace) -> int:
    """Make the page or the pictures of a run."""
    need("a report", "matplotlib")
    from kmpc_lite.report import write_pictures, write_report
    from kmpc_lite.sim import Run

    keep_inputs(options.output, options.file, options.model)
    drive = Run.load(options.file)
    model = kl.KoopmanModel.load(options.model) if options.model else None
    written: list[str] = []
    if options.pictures:
        written += [str(f) for f in write_pictures(options.pictures, drive)]
    if options.output or not options.pictures:
        page = options.output or options.file.with_suffix(".html")
        write_report(page, drive, model=model, command=command_line())
        written.append(str(page))
    lines = "\n".join(f"wrote  {name}" for name in written)
    print(json.dumps({"written": written}) if options.json else lines)
    return 0


COMMAND = Command(
    text="Show a run as one HTML page, or as PNG pictures.",
    examples=("kmpc report run.npz -o run.html", "kmpc report run.npz --pictures figures"),
    add_options=add_options,
    run=run,
)
