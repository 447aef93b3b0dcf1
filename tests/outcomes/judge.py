"""Whether a drive is as good as what is recorded."""

from __future__ import annotations

import statistics
from collections.abc import Iterable

from outcomes.files import Line, ratios
from outcomes.rows import ROWS
from outcomes.setup import Row

TIME, PERIODS = 0.03, 2
"""A row may take longer by this share and these periods, and by twice its recorded spread."""
CLEARANCE = 0.1
"""By how much the least clearance may be smaller [radii], beside twice its recorded spread."""
NEAR = 1.0  # clearances beyond are not judged [radii]
DEPTH = 0.05  # by how much a known contact may be deeper [radii]
GEARS = 1  # more changes of gear than recorded
FAMILY_CHATTER = 0.05
"""Largest share of steps in which a command jumps back, in the median of a family."""
WORSE = 0.05
"""By how much the share of a row, or of a family, that is known to chatter may be larger than
recorded."""
STOPPED = 0.05  # by how much the share of steps STOPPED may be larger
FAMILY = 5  # fewest drives of a family whose median ratio of times is judged


def complaints(old: Line, new: Line) -> list[str]:
    """What of a drive is worse than recorded, in words."""
    was, now, found = old.result, new.result, []
    if now.faults:
        found.append(f"expected no fault, got {now.faults}")
    if now.contacts > was.contacts:
        found.append(f"contacts: expected {was.contacts}, got {now.contacts} ({now.depth:.2f} r)")
    elif now.contacts and now.depth > was.depth + DEPTH:
        found.append(f"contact: expected {was.depth:.2f} r deep, got {now.depth:.2f} r")
    if now.ended not in old.ends and now.ended != "arrived":
        found.append(f"expected {'/'.join(sorted(old.ends))}, got {now.ended}")
    elif now.ended == "arrived" and was.ended == "arrived":
        share = TIME + 2.0 * old.time_spread / 100.0
        most = (1.0 + share) * was.time + PERIODS * was.dt
        if now.time > most + 1e-9:
            found.append(f"time: expected at most {most:.2f} s, got {now.time:.2f} s")
    least = min(was.clearance, NEAR) - CLEARANCE - 2.0 * old.clear_spread
    if now.clearance < least and not was.contacts:
        found.append(f"clearance: expected at least {least:.2f} r, got {now.clearance:.2f} r")
    if now.gears > was.gears + GEARS:
        found.append(f"gears: expected at most {was.gears + GEARS} changes, got {now.gears}")
    if now.stopped > was.stopped + STOPPED:
        most = 100.0 * (was.stopped + STOPPED)
        found.append(f"STOPPED: expected at most {most:.0f} %, got {100.0 * now.stopped:.0f} %")
    most = ROWS[now.name].chatter if now.name in ROWS else Row.chatter
    if was.chatter > most:
        most = was.chatter + WORSE
    if now.sound and now.chatter > most:
        found.append(
            f"chatter: expected at most {100.0 * most:.0f} %, got {100.0 * now.chatter:.0f} %"
        )
    return found


def shaky(pairs: Iterable[tuple[Line, Line]]) -> list[str]:
    """Families whose median share of steps in which a command jumps back is too large."""
    shares: dict[str, list[tuple[float, float]]] = {}
    for old, new in pairs:
        shares.setdefault(old.result.family, []).append((old.result.chatter, new.result.chatter))
    found = []
    for family, both in shares.items():
        was, now = (statistics.median(share) for share in zip(*both, strict=True))
        most = FAMILY_CHATTER if was <= FAMILY_CHATTER else was + WORSE
        if len(both) >= FAMILY and now > most:
            found.append(
                f"{family}: expected chatter of at most {100 * most:.0f} % in the median, "
                f"got {100 * now:.1f} %"
            )
    return found


def slower(pairs: Iterable[tuple[Line, Line]]) -> list[str]:
    """Families, and all drives, whose median ratio of times is too large."""
    return [
        f"{family}: expected a median ratio of times of at most {1.0 + TIME:g}, got {ratio:.3f} "
        f"({count} drives)"
        for family, (count, ratio) in ratios(pairs).items()
        if count >= FAMILY and ratio > 1.0 + TIME
    ]
