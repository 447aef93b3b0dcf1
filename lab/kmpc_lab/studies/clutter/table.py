"""The table of `kmpc study clutter`: a row for every condition and driver."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np

from kmpc_lab.studies.clutter.drivers import CONDITIONS, DRIVERS
from kmpc_lab.studies.clutter.drives import ClutterDrive, drive
from kmpc_lab.studies.records import Work

PUBLIC = 300
"""Worlds of the public set."""
PUBLISHED = """\
Published, in Gazebo with ROS and on other worlds, not to be compared with this kinematic replica:
  LiCS-KI 98.0 %, score 0.489, 7.7 s; DRL-VO 93.6 %, 0.371; DWA of move_base 85.0 %, 0.159;
  an NMPC with acados 0.4515 (2026, second-hand)"""


def study(
    work: Work,
    seeds: Sequence[int],
    conditions: Sequence[str] = ("exact", "noisy"),
    drivers: Sequence[str] = DRIVERS,
    moving: bool = False,
    barn: str = "",
    repeats: int = 1,
) -> list[ClutterDrive]:
    """Drive every world with every driver; rows in the order of conditions, drivers, worlds."""
    again = range(repeats)
    wanted = [
        (driver, condition, seed, moving, barn, k)
        for condition, driver, seed, k in product(conditions, drivers, seeds, again)
    ]
    return work.rows("clutter", wanted, drive, ClutterDrive)


def summary(rows: Sequence[ClutterDrive]) -> dict[str, Any]:
    """What became of one driver's drives; times are of those that arrived."""
    times = [row.seconds for row in rows if row.arrived]

    def mean(name: str) -> float:
        return float(np.mean([getattr(row, name) for row in rows]))

    return {
        "drives": len(rows),
        "arrived": len(times),
        "collisions": sum(row.collided for row in rows),
        "seconds": float(np.mean(times)) if times else float("nan"),
        **{
            name: mean(name)
            for name in ("score", "reverses", "turns", "fallback", "feasible", "jerk")
        },
        **{name: mean(name) for name in ("step_p50", "step_p99")},
    }


def format_rows(rows: Sequence[ClutterDrive], published: bool = True) -> str:
    """Table, every drive of ours that did not arrive, and what others publish."""
    lines = [
        f"{'':6} {'':8} drives arrived hit  score   time  back  turn FALLBACK FEASIBLE  jerk"
        "  p50  p99 ms"
    ]
    for condition, driver in product(CONDITIONS, DRIVERS):
        some = [row for row in rows if (row.condition, row.driver) == (condition, driver)]
        if some:
            lines.append(_line(condition, driver, summary(some)))
    lines += [
        f"{row.condition}, {row.driver}, {row.world}: "
        + ("touched" if row.collided else row.ended or "out of time")
        for row in rows
        if not row.arrived
    ]
    return "\n".join([*lines, PUBLISHED] if published else lines)


def _line(condition: str, driver: str, s: dict[str, Any]) -> str:
    """A row of the table."""
    told = f"{condition:6} {driver:8} {s['drives']:6d} {s['arrived']:7d} {s['collisions']:3d} "
    told += f"{s['score']:6.4f} {s['seconds']:6.2f} "
    told += f"{100 * s['reverses']:4.0f}% {100 * s['turns']:4.0f}% "
    if driver == "ours":
        told += f"{100 * s['fallback']:7.1f}% {100 * s['feasible']:7.1f}% {s['jerk']:5.3f} "
        return told + f"{s['step_p50']:4.1f} {s['step_p99']:4.1f}"
    return told + f"{'':17} {s['jerk']:5.3f}"
