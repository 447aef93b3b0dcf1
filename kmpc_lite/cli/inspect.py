"""`kmpc inspect`: what is in a log, before anything is learned from it."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from kmpc_lite.cli.command import Command, keep_inputs, need, paint, part
from kmpc_lite.cli.options import add_log_options, read_options

if TYPE_CHECKING:
    from kmpc_lite.learn.loading import Findings

SUSPICIOUS = 1


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add_log_options(parser)
    text = "draw path and commands of the first log (.svg or .png)"
    parser.add_argument("--plot", type=Path, metavar="FILE", help=text)


def run(options: argparse.Namespace) -> int:
    """Tell what each log holds and what is suspect in it; exit status 1 where something is."""
    from kmpc_lite.errors import DataError
    from kmpc_lite.learn.formats.readers import find_logs
    from kmpc_lite.learn.loading import inspect

    if options.plot is not None:
        need("a picture", "matplotlib")
        keep_inputs(options.plot, *options.log)
        if options.plot.suffix.lower() not in (".svg", ".png"):
            raise DataError(f"{options.plot}: expected a picture's ending, .svg or .png")
    how = read_options(options)
    found = [inspect(file, how) for file in find_logs(options.log)]
    if options.plot is not None:
        draw_log = part("--plot", "log_picture")
        draw_log(found[0].log, options.plot)
    if options.json:
        print(json.dumps({"logs": [f.as_dict() for f in found]}))
    else:
        print("\n\n".join(describe(f) for f in found))
        if options.plot is not None:
            print(f"wrote  {options.plot}")
    return SUSPICIOUS if any(f.suspects for f in found) else 0


def describe(found: Findings) -> str:
    """One log in a block of lines."""
    lines, topics = [f"log      {found.log.name}"], found.log.topics
    width = max((len(t.name) for t in topics), default=0)
    for topic in topics:
        rate = f"{topic.rate:9.3g} Hz" if topic.rate is not None else ""
        count = f"{topic.messages:>9} messages"
        lines.append(f"topic    {topic.name:<{width}}  {topic.kind}  {count}{rate}".rstrip())
    lines += [f"{name:<8} {text}" for name, text in found.lines.items()]
    lines += [f"note     {text}" for text in found.notes]
    lines += [paint(f"suspect  {text}", "red", sys.stdout) for text in found.suspects]
    lines += [f"doubt    {text}" for text in found.doubts]
    good = () if found.suspects or found.doubts else ("good     nothing is suspect",)
    return "\n".join([*lines, *good])


COMMAND = Command(
    text="Show what a log holds and what is suspect in it, before you learn from it.",
    examples=(
        "kmpc inspect run.csv",
        "kmpc inspect rosbag2_2026_03_01/ --topics odom=/odom cmd=/cmd_vel --plot run.svg",
    ),
    add_options=add_options,
    run=run,
)
