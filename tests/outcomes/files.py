"""Results as text: one line a drive, which `expected.csv` consists of, too."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from outcomes.loop import Result
from outcomes.rows import ROWS

EXPECTED = Path(__file__).parent / "expected.csv"
HEAD = """\
# What comes of each drive: contacts and their deepest depth [radii], how it ended, time to arrive
# or until it ended [s], least clearance [radii], changes of gear, shares of steps STOPPED, FALLBACK
# and FEASIBLE [%], mean SQP passes a step, RMS of the change of commands (share of the bounds),
# steps in which a command jumps back [%], period [s]. "+-": how far the time [%] and the clearance
# moved when measured poses were changed by 1e-9 radii, three times: twice that widens the band
# within which a row is judged. Of such drives contacts, changes of gear, shares STOPPED and jumps
# back are the largest, and all ends are listed. "!" marks a known failure: a row that touches, or
# does not end as it should. Written by `python -m outcomes record`.
"""
COLUMNS = (
    "!",
    "seed",
    "contacts",
    "depth",
    "ended",
    "time",
    "+-",
    "clear",
    "+-",
    "gears",
    "stop",
    "fall",
    "feas",
    "passes",
    "jerk",
    "chatter",
    "dt",
    "family",
    "name",
)


@dataclass
class Line:
    """A result with how far it moves under perturbation."""

    result: Result
    seed: int = 0
    ends: frozenset[str] = frozenset()  # how the drive and its perturbed twins ended
    time_spread: float = 0.0  # [%]
    clear_spread: float = 0.0  # [radii]

    @property
    def fails(self) -> bool:
        """Whether the row is a known failure."""
        row = ROWS.get(self.result.name)
        if row is None:
            return False
        touched = self.result.contacts > 0 and not row.touches
        return touched or not self.ends <= set(row.right.split("/"))


def line_of(results: Sequence[Result], seed: int = 0) -> Line:
    """One line of a drive and its perturbed twins."""
    first = results[0]
    times = [r.time for r in results if r.ended == first.ended]
    clear = [r.clearance for r in results]
    spread = 100.0 * max(abs(time - first.time) for time in times) / max(first.time, first.dt)
    worst = Result(**vars(first))
    worst.contacts = max(r.contacts for r in results)
    worst.depth = max(r.depth for r in results)
    worst.gears = max(r.gears for r in results)
    worst.stopped = max(r.stopped for r in results)
    worst.chatter = max(r.chatter for r in results)
    ends = frozenset(r.ended for r in results)
    moved = max(clear) - min(clear) if math.isfinite(max(clear)) else 0.0
    return Line(worst, seed, ends, spread, moved)


def to_text(lines: Iterable[Line], note: str = "") -> str:
    """The file, with a head."""
    out = [HEAD + "".join(f"# {part}\n" for part in note.splitlines())]
    widths = (1, 4, 8, 5, 11, 7, 5, 6, 5, 5, 5, 5, 5, 6, 5, 7, 4, 13, 4)
    out.append(",".join(f"{c:>{w}}" for c, w in zip(COLUMNS, widths, strict=True)) + "\n")
    for line in lines:
        r = line.result
        values = (
            "!" if line.fails else " ",
            str(line.seed),
            str(r.contacts),
            f"{r.depth:.2f}",
            "/".join(sorted(line.ends)),
            f"{r.time:.2f}",
            f"{line.time_spread:.1f}",
            f"{r.clearance:.2f}",
            f"{line.clear_spread:.2f}",
            str(r.gears),
            *(f"{100 * share:.1f}" for share in (r.stopped, r.fallback, r.feasible)),
            f"{r.passes:.2f}",
            f"{r.jerk:.3f}",
            f"{100 * r.chatter:.1f}",
            f"{r.dt:g}",
            r.family,
            r.name,
        )
        out.append(",".join(f"{v:>{w}}" for v, w in zip(values, widths, strict=True)) + "\n")
    return "".join(out)


def read(path: Path = EXPECTED) -> dict[tuple[str, int], Line]:
    """Lines of a file by name and seed."""
    lines = {}
    for text in path.read_text(encoding="utf-8").splitlines():
        if text.startswith("#") or "contacts" in text.split(",")[2:3] or not text.strip():
            continue
        parts = [part.strip() for part in text.split(",", len(COLUMNS) - 1)]
        if parts[2] == "contacts":
            continue
        _, seed, contacts, depth, ended, *numbers = parts[:-2]
        time, spread, clear, moved, gears, *rest = map(float, numbers)
        stop, fall, feas, passes, jerk, chatter, dt = rest
        ends = ended.split("/")
        result = Result(
            parts[-1],
            parts[-2],
            int(contacts),
            float(depth),
            ends[0],
            time,
            clear,
            int(gears),
            stop / 100.0,
            fall / 100.0,
            feas / 100.0,
            passes,
            jerk,
            chatter / 100.0,
            dt,
        )
        key = result.name, int(seed)
        lines[key] = Line(result, int(seed), frozenset(ends), spread, moved)
    return lines


def ratios(pairs: Iterable[tuple[Line, Line]]) -> dict[str, tuple[int, float]]:
    """Drives and median ratio of times of each family, new over old; ``all`` is the last one."""
    found: dict[str, list[float]] = {}
    for old, new in pairs:
        if "arrived" in old.ends and old.ends == new.ends:
            ratio = new.result.time / max(old.result.time, old.result.dt)
            found.setdefault(old.result.family, []).append(ratio)
    found["all"] = [ratio for family in found.values() for ratio in family]
    return {k: (len(v), float(np.median(v))) for k, v in sorted(found.items()) if v}
