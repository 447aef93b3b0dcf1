"""The table of `kmpc study sight`: a row for every robot, kind of world and reach."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from kmpc_lab.studies.records import Work
from kmpc_lab.studies.sight.drives import ROBOTS, SightDrive, drive
from kmpc_lab.studies.sight.worlds import KINDS

DRIVERS = "ours", "pursuit"


def study(
    work: Work,
    seeds: Sequence[int],
    kinds: Sequence[str] = tuple(KINDS),
    reaches: Sequence[float] = (2.0, 4.0, 8.0),
    robots: Sequence[str] = tuple(ROBOTS),
) -> list[SightDrive]:
    """Drive every world with both drivers; rows in the order of robots, kinds, reaches, seeds."""
    worlds = product(robots, kinds, reaches, seeds)
    wanted = [(driver, *world) for world in worlds for driver in DRIVERS]
    return work.rows("sight", wanted, drive, SightDrive)


def summary(rows: Sequence[SightDrive]) -> dict[str, Any]:
    """What became of the drives of ours, and how they compare with pursuit's of the same worlds.

    ``ratio`` is of the times in each world, ``times`` of the quantiles of all times.
    """
    ours = [row for row in rows if row.driver == "ours"]
    theirs = {_world(row): row for row in rows if row.driver == "pursuit"}
    both = [
        (row.seconds, other.seconds)
        for row in ours
        if row.arrived and (other := theirs.get(_world(row))) is not None and other.arrived
    ]
    # if neither arrived there is nothing to compare
    times, its = np.array(both or [(math.nan, math.nan)]).T
    return {
        "drives": len(ours),
        "arrived": sum(row.arrived for row in ours),
        "collisions": sum(row.collided for row in ours),
        "pursuit_arrived": sum(row.arrived for row in theirs.values()),
        "pursuit_collisions": sum(row.collided for row in theirs.values()),
        "ratio_median": float(np.median(times / its)),
        "ratio_p90": float(np.quantile(times / its, 0.9)),
        "times_median": float(np.median(times) / np.median(its)),
        "times_p90": float(np.quantile(times, 0.9) / np.quantile(its, 0.9)),
        "gears_median": float(np.median([row.gears for row in ours])) if ours else math.nan,
        "stopped": float(np.mean([row.stopped for row in ours])) if ours else math.nan,
        "unseen": sum(row.unseen for row in ours),
        "unreachable": sum(row.unreachable for row in ours),
        "step_p99_ms": float(np.median([row.step_p99 for row in ours])) if ours else math.nan,
    }


def format_rows(rows: Sequence[SightDrive]) -> str:
    """Table, and every drive of ours that did not arrive."""
    head = (
        f"{'robot':12} {'world':7} reach drives arrived hit  pursuit: arrived hit"
        "  time/its p90  median p90/its  gears stopped unseen unreachable p99 ms"
    )
    lines = [head]
    for key in dict.fromkeys((row.robot, row.kind, row.reach) for row in rows):
        some = [row for row in rows if (row.robot, row.kind, row.reach) == key]
        lines.append(_line(*key[:2], f"{key[2]:g}", some))
    for robot in dict.fromkeys(row.robot for row in rows):
        lines.append(_line(robot, "all", "all", [row for row in rows if row.robot == robot]))
    lines += [
        f"{row.robot}, {row.kind} {row.seed}, reach {row.reach:g} m: "
        + ("touched" if row.collided else row.ended or "out of time")
        for row in rows
        if row.driver == "ours" and not row.arrived
    ]
    return "\n".join(lines)


def _line(robot: str, kind: str, reach: str, rows: Sequence[SightDrive]) -> str:
    """A row of the table."""
    s = summary(rows)
    return (
        f"{robot:12} {kind:7} {reach:>5} {s['drives']:6d} {s['arrived']:7d} "
        f"{s['collisions']:3d} {s['pursuit_arrived']:17d} {s['pursuit_collisions']:3d} "
        f"{s['ratio_median']:9.2f} {s['ratio_p90']:4.2f} "
        f"{s['times_median']:7.2f} {s['times_p90']:7.2f} {s['gears_median']:6.1f} "
        f"{100 * s['stopped']:6.1f}% {s['unseen']:6d} {s['unreachable']:11d} "
        f"{s['step_p99_ms']:6.1f}"
    )


def _world(row: SightDrive) -> tuple[str, str, float, int]:
    return row.robot, row.kind, row.reach, row.seed
