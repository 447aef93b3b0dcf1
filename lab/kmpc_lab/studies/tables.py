"""Counts, intervals and tables of a study over random maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from kmpc_lab.studies.records import Record

Key = tuple[str, str, str, float | None, float, int]
CONFIDENCE = 1.959964
"""Quantile of the normal distribution for intervals of 95 %."""


def drive_key(record: Mapping[str, Any]) -> Key:
    """Identity of a drive: controller, condition, family, slip of the training, slip, seed."""
    trained = None if record["trained_at"] is None else float(record["trained_at"])
    return (
        record["controller"],
        record["condition"],
        record["family"],
        trained,
        float(record["slip"]),
        int(record["seed"]),
    )


def wilson(successes: int, trials: int) -> tuple[float, float]:
    """Interval (low, high) of 95 % for a share, after Wilson; (0, 1) without trials.

    Examples
    --------
    >>> low, high = wilson(98, 100)
    >>> round(low, 3), round(high, 3)
    (0.93, 0.994)
    """
    if not trials:
        return 0.0, 1.0
    z2 = CONFIDENCE * CONFIDENCE
    share = successes / trials
    middle = (share + z2 / (2 * trials)) / (1 + z2 / trials)
    half = (
        CONFIDENCE
        / (1 + z2 / trials)
        * float(np.sqrt(share * (1 - share) / trials + z2 / (4 * trials**2)))
    )
    # rounding must not exclude the share itself
    return max(min(middle - half, share), 0.0), min(max(middle + half, share), 1.0)


@dataclass(frozen=True)
class Row:
    """One controller under one condition on one family at one slip; slip None: at all slips."""

    controller: str
    condition: str
    family: str
    slip: float | None
    drives: int
    collisions: int
    at_position: int
    """Drives without collision that came within the tolerance of the goal's position."""
    at_pose: int
    """Those that came within position and heading tolerance at once."""
    position_s: float | None
    """Mean time until there [s]."""
    pose_s: float | None
    clearance_m: float | None
    """Smallest over all drives."""

    def as_dict(self) -> dict[str, Any]:
        """Plain values with intervals, for JSON."""
        shares = {
            name: wilson(getattr(self, name), self.drives)
            for name in ("collisions", "at_position", "at_pose")
        }
        return {
            **self.__dict__,
            "wilson_95": {
                name: [round(v, 5) for v in interval] for name, interval in shares.items()
            },
        }


def summarise(records: Sequence[Record]) -> list[Row]:
    """Count by controller, condition, family and slip, and over all slips of each."""
    rows = []
    for own_key in dict.fromkeys((r["controller"], r["condition"], r["family"]) for r in records):
        own = [r for r in records if (r["controller"], r["condition"], r["family"]) == own_key]
        slips: list[float | None] = list(dict.fromkeys(r["slip"] for r in own))
        for slip in [*slips, *([None] if len(slips) > 1 else [])]:
            rows.append(_row(*own_key, slip, [r for r in own if slip is None or r["slip"] == slip]))
    return rows


def _row(
    controller: str, condition: str, family: str, slip: float | None, records: Sequence[Record]
) -> Row:
    untouched = [r for r in records if r["collision_s"] is None]

    def mean(key: str) -> float | None:
        values = [r[key] for r in untouched if r[key] is not None]
        return float(np.mean(values)) if values else None

    return Row(
        controller,
        condition,
        family,
        slip,
        len(records),
        len(records) - len(untouched),
        sum(r["position_s"] is not None for r in untouched),
        sum(r["pose_s"] is not None for r in untouched),
        mean("position_s"),
        mean("pose_s"),
        min((r["clearance_m"] for r in records if r["clearance_m"] is not None), default=None),
    )


def time_ratio(
    records: Sequence[Record], controller: str, reference: str
) -> tuple[int, float | None]:
    """Compare mean times to the pose on the drives in which two controllers both arrive, untouched.

    Returns
    -------
    count, ratio : int, float or None
        Of such drives, and of the controller's mean time to the reference's.
    """

    def times(label: str) -> dict[tuple[Any, ...], float]:
        arrived = (
            r
            for r in records
            if r["controller"] == label and r["collision_s"] is None and r["pose_s"] is not None
        )
        return {(r["condition"], r["family"], r["slip"], r["seed"]): r["pose_s"] for r in arrived}

    ours, theirs = times(controller), times(reference)
    both = ours.keys() & theirs.keys()
    return len(both), sum(ours[k] for k in both) / sum(theirs[k] for k in both) if both else None


def seconds(value: float | None) -> str:
    """Tell a time [s]; a dash if there is none."""
    return "-" if value is None else f"{value:.2f}"


def format_maps(rows: Sequence[Row]) -> str:
    """Render as a table, with intervals of 95 % (Wilson) in brackets."""

    def share(count: int, drives: int) -> str:
        low, high = wilson(count, drives)
        return f"{100 * count / drives:5.1f} % [{100 * low:.1f}, {100 * high:.1f}]"

    widest = max(len(row.controller) for row in rows)
    conditions = max(len(row.condition) for row in rows)
    under = f"{'condition':<{max(conditions, 9)}}  " if conditions else ""
    lines = [
        f"{'controller':<{max(widest, 10)}}  {under}{'maps':<9}{'lambda':>7}{'drives':>8}  "
        f"{'collisions':<22}{'within 5 cm':<23}"
        f"{'and 0.15 rad':<23}{'s to 5 cm':>10}{'s to pose':>10}{'least gap':>11}"
    ]
    for row in rows:
        gap = "-" if row.clearance_m is None else f"{1e3 * row.clearance_m:.0f} mm"
        slip = "all" if row.slip is None else f"{row.slip:g}"
        collisions = (
            f"{row.collisions} [{100 * wilson(row.collisions, row.drives)[0]:.1f}, "
            f"{100 * wilson(row.collisions, row.drives)[1]:.1f}] %"
        )
        condition = f"{row.condition or '-':<{max(conditions, 9)}}  " if conditions else ""
        lines.append(
            f"{row.controller:<{max(widest, 10)}}  "
            f"{condition}{row.family:<9}{slip:>7}{row.drives:>8}  {collisions:<22}"
            f"{share(row.at_position, row.drives):<23}{share(row.at_pose, row.drives):<23}"
            f"{seconds(row.position_s):>10}{seconds(row.pose_s):>10}{gap:>11}"
        )
    return "\n".join(lines)
