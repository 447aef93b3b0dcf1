"""`kmpc report`: show a drive, simulated or real, as one HTML page, or as a picture."""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import kmpc_lite as kl
from kmpc_lite.cli.command import Command, command_line, keep_inputs, need

if TYPE_CHECKING:
    from kmpc_lab.sim.closed_loop import Run


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    text = "recorded drive: a folder, or the .mcap in it, that --record wrote"
    add("file", type=Path, metavar="drive", help=text)
    text = "page to write (default: report.html in the folder)"
    add("-o", "--output", type=Path, metavar="FILE", help=text)
    add("--model", type=Path, metavar="FILE", help="model of the run, to show how it was fitted")
    text = "play from this time on [s]; of a long drive every step is then there"
    add("--from", dest="begin", type=float, metavar="S", help=text)
    add("--to", dest="end", type=float, metavar="S", help="play to this time [s]")
    add("--picture", type=Path, metavar="FILE", help="picture to write (.png, .svg), not the page")
    text = "more drives on the same map: page and picture show all"
    add("--beside", type=Path, nargs="+", default=[], metavar="DRIVE", help=text)


def run(options: argparse.Namespace) -> int:
    """Make the page or the picture of a run."""
    need("a report", "matplotlib")
    from kmpc_lab.recording.drive_file import load_drive
    from kmpc_lab.report.html import write_report
    from kmpc_lab.report.runs import check_one_map, draw_drives

    keep_inputs(options.output or options.picture, options.file, options.model)
    drive = load_drive(options.file)
    if options.begin is not None or options.end is not None:
        drive = _between(drive, options.begin, options.end)
    model = kl.KoopmanModel.load(options.model) if options.model else None
    written: list[str] = []
    others = {str(file): load_drive(file) for file in options.beside}
    check_one_map({str(options.file): drive, **others})
    if options.picture:
        files = [options.file, *options.beside]
        runs = zip(files, (drive, *others.values()), strict=True)
        draw_drives(options.picture, {file.stem: run for file, run in runs})
        written.append(str(options.picture))
    if options.output or not options.picture:
        page = options.output or _beside(options.file)
        write_report(page, drive, model=model, command=command_line(), beside=others)
        written.append(str(page))
    lines = "\n".join(f"wrote  {name}" for name in written)
    print(json.dumps({"written": written}) if options.json else lines)
    return 0


def _between(drive: Run, begin: float | None, end: float | None) -> Run:
    """Give the drive with the steps of a part of it."""
    assert drive.details is not None  # it was recorded
    part = drive.details.between(
        -math.inf if begin is None else begin, math.inf if end is None else end
    )
    return replace(drive, details=part)


def _beside(run: Path) -> Path:
    """Where the page of a run goes: into its folder, or beside its file."""
    return run / "report.html" if run.is_dir() else run.with_suffix(".html")


COMMAND = Command(
    text="Show a drive as one HTML page, or as a picture.",
    examples=(
        "kmpc report drives/monday     # a folder of kmpc run --record, or kmpc simulate --record",
        "kmpc report monday --beside tuesday   # both on one map, at the same time",
        "kmpc report monday --picture monday.png",
    ),
    add_options=add_options,
    run=run,
)
