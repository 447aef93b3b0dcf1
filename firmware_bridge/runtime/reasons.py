"""Why a robot does not drive, each reason once; and how a drive ended, in one sentence."""

from __future__ import annotations

import math
from collections.abc import Iterable


def told_once(reasons: Iterable[str], words: Iterable[str]) -> list[str]:
    """Put an autopilot's own words behind what is known, but for those that it contains already.

    Examples
    --------
    >>> told_once(["link down", "arming is refused for now: Arm: no GPS"], ["PreArm: no GPS"])
    ['link down', 'arming is refused for now: Arm: no GPS']
    """
    known = list(dict.fromkeys(reasons))
    more = (text for text in words if not any(_gist(text) in reason for reason in known))
    return [*known, *dict.fromkeys(more)]


def ended_words(
    what: str, after: float, errors: tuple[float, float], goal: str, why: Iterable[str]
) -> str:
    """Say in one sentence how a drive ended that did not arrive: the same wherever it is shown.

    `what`: happened. `after`: time since the robot was first let drive [s]. `errors`: distance to
    the goal [m] and heading error [rad]; infinite if no pose is known. `goal`: which goal of how
    many; empty for a single one. `why`: what kept it from arriving.

    Examples
    --------
    >>> ended_words("time is up", 20.0, (0.52, 0.1), "", ["no passage is wide enough"])
    'time is up after 20.0 s, 0.52 m and 0.10 rad from the goal: no passage is wide enough'
    """
    distance, turn = errors
    known = f", {distance:.2f} m and {turn:.2f} rad from {goal or 'the goal'}"
    where = known if math.isfinite(distance) else ""
    reasons = "; ".join(why)
    return f"{what} after {after:.1f} s{where}" + (f": {reasons}" if reasons else "")


def _gist(text: str) -> str:
    """The text behind "Arm:" or "PreArm:"; the autopilot says the same behind either."""
    return text.rpartition("Arm:")[2].strip()
