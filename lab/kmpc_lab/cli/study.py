"""`kmpc study`: one command a study of `kmpc_lab.studies.catalogue`."""

from __future__ import annotations

import argparse
import json
from functools import partial
from pathlib import Path

from kmpc_lab.studies.catalogue import STUDIES
from kmpc_lab.studies.study import Study, Work, check_resume, executor
from kmpc_lite.cli.command import Command, ProgressBar, count, need


def add_options(study: Study, parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads: what a study needs, its axes, and what runs it."""
    add = parser.add_argument
    for name, (read, text) in study.needs.items():
        add(f"--{name}", type=read, required=True, metavar=name.upper(), help=text)
    for name, axis in study.axes.items():
        values = "; ".join(map(str, axis.values)).replace("%", "%%")
        usual = f" (default: {'; '.join(map(str, axis.usual)) or 'all'})"
        add(f"--{name}", nargs="+", metavar="WORD", help=f"{axis.text}: {values}{usual}")
    usual = f"{study.course}s of each row (default: {study.drives})"
    add("--drives", type=count, default=study.drives, metavar="N", help=usual)
    usual = f"of the first {study.course} (default: {study.seed}, from which figures are reported)"
    add("--seed", type=int, default=study.seed, metavar="S", help=usual)
    add("--workers", type=count, metavar="N", help="processes (default: all cores)")
    text = "Dask scheduler that runs the drives: tcp://HOST:8786 (extra cluster)"
    add("--cluster", metavar="ADDRESS", help=text)
    text = "file to which each result is added at once (.jsonl)"
    add("--records", type=Path, metavar="FILE", help=text)
    add("--resume", action="store_true", help="continue from the results in the records file")
    text = "picture of the worst drive of ours to write (.png)"
    add("--picture", type=Path, metavar="FILE", help=text)


def run(study: Study, options: argparse.Namespace) -> int:
    """Drive what is asked for; status 1 if a drive of ours touched something."""
    given = [getattr(options, name.replace("-", "_")) for name in study.needs]
    values = [axis.choose(f"--{name}", getattr(options, name)) for name, axis in study.axes.items()]
    check_resume(options.records, options.resume)
    if options.picture is not None:
        need("a picture", "matplotlib")
    study.prepare(values)
    wanted = study.asked(values, range(options.seed, options.seed + options.drives), given)
    bar = ProgressBar(study.name, quiet=options.json)
    with executor(options.workers, options.cluster) as started:
        rows = Work(started, bar, options.records).rows(study, wanted)
    told = [row.as_record() for row in rows]
    print(json.dumps(told) if options.json else study.render(rows))
    if options.picture is not None:
        from kmpc_lab.studies.table import draw_worst

        draw_worst(study, dict(zip(wanted, rows, strict=True)), options.picture)
    return int(any(row.collided and not row.peer for row in rows))


COMMAND = Command(
    text="Reproduce the paper's table 1 beside ours, or drive random maps and robots.\n"
    "Each study has a --help of its own.",
    examples=(
        "kmpc study table1 --drives 100 --json > table1.json",
        "kmpc study maps --families dense trap moving --slips 0.1",
        "kmpc study parking --records cars.jsonl --picture worst.png",
    ),
    commands={
        name: Command(
            text=study.text,
            examples=study.examples,
            add_options=partial(add_options, study),
            run=partial(run, study),
        )
        for name, study in STUDIES.items()
    },
)
