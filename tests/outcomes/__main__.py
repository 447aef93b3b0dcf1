"""Commands of the outcome drives: ``python -m outcomes --help``."""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Iterable
from pathlib import Path

# before NumPy is loaded, here and in the workers
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from outcomes import bits, judge
from outcomes.files import EXPECTED, Line, line_of, ratios, read, to_text
from outcomes.loop import drive_row
from outcomes.rows import ROWS
from outcomes.runner import Key, chosen, drive_all

TWINS = 3  # perturbed drives beside each that is recorded


def say(text: str) -> None:
    """Write a line."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def driven(keys: list[Key], jobs: int) -> dict[tuple[str, int], Line]:
    """Drive all; one line for each row and seed, with its perturbed twins."""
    lines: dict[tuple[str, int], Line] = {}
    results: dict[tuple[str, int], list] = {}
    begun = time.monotonic()
    for count, done in enumerate(drive_all(keys, jobs), 1):
        if done.result is None:
            say(f"{done.key[0]}: left out, its log is not here")
            continue
        results.setdefault(done.key[:2], []).append(done.result)
        if sys.stderr.isatty() or count % 100 == 0:
            sys.stderr.write(f"\r{count} of {len(keys)}, {time.monotonic() - begun:.0f} s ")
            sys.stderr.flush()
    for key, found in results.items():
        lines[key] = line_of(found, key[1])
    return lines


def note() -> str:
    """Where results come from."""
    import numpy
    import osqp
    import scipy

    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False
    ).stdout.strip()
    return (
        f"Commit {commit or 'unknown'}; numpy {numpy.__version__}, scipy {scipy.__version__}, "
        f"osqp {osqp.__version__}"
    )


def record(given: argparse.Namespace) -> int:
    """Drive rows with their perturbed twins and write what is expected."""
    rows = chosen(given.rows)
    keys = [(row.name, 0, twin) for row in rows for twin in range(TWINS + 1)]
    lines = read() if given.rows and EXPECTED.exists() else {}
    lines |= driven(keys, given.jobs)
    order = {name: number for number, name in enumerate(ROWS)}
    kept = sorted((k for k in lines if k[0] in order), key=lambda k: order[k[0]])
    EXPECTED.write_text(to_text((lines[k] for k in kept), note()), encoding="utf-8")
    bad = [k[0] for k in kept if lines[k].fails]
    say(f"{len(keys) // (TWINS + 1)} rows recorded; {len(kept)} in all, {len(bad)} known failures")
    return 0


def check(given: argparse.Namespace) -> int:
    """Drive rows and compare them with what is expected."""
    expected = read()
    rows = chosen(given.rows, given.quick)
    begun = time.monotonic()
    lines = driven([(r.name, s, 0) for r in rows for s in range(given.seeds)], given.jobs)
    bad = 0
    for (name, seed), line in lines.items():
        for complaint in complaints_of(expected, line):
            bad += 1
            more = f" --seed {seed}" if seed else ""
            say(f'{name}: {complaint}; see it: python -m outcomes plot "{name}"{more}')
    pairs = [(expected[k], line) for k, line in lines.items() if k in expected]
    if not given.rows:
        for complaint in (*judge.slower(pairs), *judge.shaky(pairs)):
            bad += 1
            say(complaint)
    table(ratios(pairs))
    if given.to:
        Path(given.to).write_text(to_text(lines.values(), note()), encoding="utf-8")
    shares = [100.0 * line.result.chatter for line in lines.values()]
    say(f"commands jump back in {statistics.median(shares or [0.0]):.1f} % of the steps (median)")
    say(f"{len(lines)} drives in {time.monotonic() - begun:.0f} s, {bad} complaints")
    return 1 if bad else 0


def complaints_of(expected: dict[tuple[str, int], Line], line: Line) -> list[str]:
    """What is worse than recorded; of seeds that are not recorded, what must never be."""
    key = line.result.name, line.seed
    if key in expected:
        return judge.complaints(expected[key], line)
    row, known = ROWS[line.result.name], expected.get((line.result.name, 0))
    if known is None:
        return ["not recorded: python -m outcomes record --rows ..."]
    found = [f"expected no fault, got {line.result.faults}"] if line.result.faults else []
    if line.result.contacts and not row.touches and not known.result.contacts:
        found.append(f"expected no contact, got one of {line.result.depth:.2f} r")
    if line.result.ended not in row.right.split("/") and not known.fails:
        found.append(f"expected {row.right}, got {line.result.ended}")
    return found


def table(found: dict[str, tuple[int, float]]) -> None:
    """Median ratios of times by family."""
    for family, (count, ratio) in found.items():
        say(f"{family:16} {count:5d} arrived, median ratio of times {ratio:.3f}")


def compare(given: argparse.Namespace) -> int:
    """Table of drives whose outcome differs between two files of results."""
    old, new = read(Path(given.old)), read(Path(given.new))
    both = [key for key in old if key in new]
    say(f"{'ended':23} {'contacts':>9} {'time':>15} {'clear':>11} {'gears':>7} {'stop %':>11}  row")
    for key in both:
        was, now = old[key].result, new[key].result
        if judge.complaints(old[key], new[key]) or judge.complaints(new[key], old[key]):
            ends = f"{was.ended} {now.ended}" if was.ended != now.ended else now.ended
            stops = f"{100 * was.stopped:.0f} {100 * now.stopped:.0f}"
            say(
                f"{ends:23} {was.contacts:4d} {now.contacts:4d} {was.time:7.2f} {now.time:7.2f} "
                f"{was.clearance:5.2f} {now.clearance:5.2f} {was.gears:3d} {now.gears:3d} "
                f"{stops:>11}  {was.family}: {was.name}" + (f" ({key[1]})" if key[1] else "")
            )
    totals(("before", old), ("after", new), both)
    table(ratios((old[key], new[key]) for key in both))
    only = [key for key in {**old, **new} if key not in both]
    if only:
        say(f"{len(only)} drives are in one file only")
    return 0


def totals(*named: tuple[str, dict[tuple[str, int], Line]] | Iterable[tuple[str, int]]) -> None:
    """Counts of contacts and arrivals."""
    *files, keys = named
    for name, lines in files:  # type: ignore[misc]
        found = [lines[key].result for key in keys]  # type: ignore[union-attr]
        touched, there = (
            sum(r.contacts > 0 for r in found),
            sum(r.ended == "arrived" for r in found),
        )
        say(f"{name}: {len(found)} drives, {there} arrived, {touched} touched")


def plot(given: argparse.Namespace) -> int:
    """Draw a drive into a PNG."""
    from outcomes.plot import draw

    rows = [ROWS[given.name]] if given.name in ROWS else chosen(given.name)
    for row in rows[:9]:
        trace = drive_row(row, given.seed)
        if trace is None:
            say(f"{row.name}: its log is not here")
            continue
        stem = "".join(c if c.isalnum() else "_" for c in row.name)
        path = Path(given.to or f"out/outcome_{stem}.png")
        path.parent.mkdir(parents=True, exist_ok=True)
        draw(row, trace, path)
        say(f"{trace.ended} {trace.time:.2f} s; {trace.reason or 'no reason given'}; wrote {path}")
    return 0 if rows else 1


def main(arguments: list[str] | None = None) -> int:
    """Run a command."""
    parser = argparse.ArgumentParser(prog="python -m outcomes", description=__doc__)
    parser.set_defaults(rows="", jobs=2, seeds=1, quick=False, to="", run=check)
    commands = parser.add_subparsers(metavar="command")
    for name, run in (
        ("record", record),
        ("check", check),
        ("save", bits.save),
        ("same", bits.same),
    ):
        one = commands.add_parser(name, help=(run.__doc__ or "").splitlines()[0])
        one.set_defaults(run=run)
        if name in ("save", "same"):
            one.add_argument("file")
        one.add_argument("--rows", default="", help="pattern of families or names")
        one.add_argument("-j", "--jobs", type=int, default=2, help="worker processes")
        if name != "record":
            one.add_argument("--quick", action="store_true", help="the rows of make test alone")
        if name == "check":
            one.add_argument("--seeds", type=int, default=1, help="seeds of each row")
            one.add_argument("--to", default="", help="file to write the results to")
    one = commands.add_parser("plot", help="draw a drive into a PNG")
    one.set_defaults(run=plot)
    one.add_argument("name")
    one.add_argument("--seed", type=int, default=0)
    one.add_argument("--to", default="")
    one = commands.add_parser("compare", help="table of two files of results")
    one.set_defaults(run=compare)
    one.add_argument("old")
    one.add_argument("new")
    given = parser.parse_args(arguments)
    result: int = given.run(given)
    return result


if __name__ == "__main__":
    sys.exit(main())
