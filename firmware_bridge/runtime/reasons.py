"""Why a robot does not drive, each reason once."""

from __future__ import annotations

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


def _gist(text: str) -> str:
    """The text behind "Arm:" or "PreArm:"; the autopilot says the same behind either."""
    return text.rpartition("Arm:")[2].strip()
