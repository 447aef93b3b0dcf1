"""What is known of a vehicle, as the rest of the bridge asks for it, and what it says itself.

The autopilot's STATUSTEXTs are put together of chunks; the reasons why it does not arm are kept.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from firmware_bridge.drivers.mavlink.options import MOCAP
from firmware_bridge.drivers.mavlink.streams import EKF_STATUS
from firmware_bridge.messages import LinkStatus

if TYPE_CHECKING:
    from firmware_bridge.drivers.mavlink.core import MavlinkCore

CHUNK = 50
"""Characters of one STATUSTEXT; longer texts come in several."""
PATIENCE = 1.0
"""Time after which a text with missing chunks is given out as far as it has come [s]."""
KEPT = 20
"""Texts that are remembered of each sort: whole, in chunks, and reasons for not arming."""
FRESH = 35.0
"""Oldest reason for not arming that still counts [s]: ArduPilot repeats it every 30 s."""
AT_ONCE = 1.5
"""ArduPilot sends all its reasons for not arming within this time [s]."""
REFUSALS = ("PreArm:", "Arm:")
GAP = " ... "


@dataclass
class _Partial:
    """A text of which chunks have come."""

    severity: int
    since: float
    chunks: dict[int, str] = field(default_factory=dict)

    @property
    def whole(self) -> bool:
        """Whether all chunks are there: the last one is shorter than a chunk."""
        last = max(self.chunks)
        return len(self.chunks) == last + 1 and len(self.chunks[last]) < CHUNK

    @property
    def text(self) -> str:
        """The chunks that have come, joined; a mark stands for each missing one."""
        known = (self.chunks.get(i, GAP) for i in range(max(self.chunks) + 1))
        return "".join(known).strip()


class StatusTexts:
    """Remembers the last texts of the vehicle."""

    def __init__(self) -> None:
        self.texts: deque[tuple[int, str]] = deque(maxlen=KEPT)
        """Severity and text, the newest last."""
        self._partial: dict[int, _Partial] = {}
        self._refusals: dict[str, tuple[str, float]] = {}

    def on_text(self, message: Any, now: float) -> str:
        """Take a STATUSTEXT; gives the text that is now whole, else an empty one."""
        self.tick(now)
        if not message.id:
            return self._keep(message.severity, message.text, now)
        if message.id not in self._partial and len(self._partial) >= KEPT:
            del self._partial[next(iter(self._partial))]
        entry = self._partial.setdefault(message.id, _Partial(message.severity, now))
        entry.chunks[message.chunk_seq] = message.text
        if not entry.whole:
            return ""
        del self._partial[message.id]
        return self._keep(entry.severity, entry.text, now)

    def tick(self, now: float) -> None:
        """Give out texts whose other chunks do not come, as far as they have come."""
        for key, entry in list(self._partial.items()):
            if now - entry.since > PATIENCE:
                del self._partial[key]
                self._keep(entry.severity, entry.text, now)

    def on_armed(self) -> None:
        """Forget why it did not arm."""
        self._refusals.clear()

    def refusals(self, now: float) -> tuple[str, ...]:
        """Why it does not arm, in its own words, each once: what it said last, all at a time."""
        newest = max((stamp for _, stamp in self._refusals.values()), default=now)
        since = max(now - FRESH, newest - AT_ONCE)
        return tuple(text for text, stamp in self._refusals.values() if stamp >= since)

    def _keep(self, severity: int, text: str, now: float) -> str:
        self.texts.append((severity, text))
        if text.startswith(REFUSALS):
            words = text.partition(":")[2].strip()
            self._refusals.pop(words, None)  # PreArm and Arm may say the same
            self._refusals[words] = text, now
            if len(self._refusals) > KEPT:
                del self._refusals[next(iter(self._refusals))]
        return text


def tells_failsafe(text: str) -> bool:
    """Whether a text reports that a failsafe acts.

    Examples
    --------
    >>> tells_failsafe("GCS Failsafe"), tells_failsafe("GCS Failsafe Cleared")
    (True, False)
    """
    lower = text.lower()
    return "failsafe" in lower and "clear" not in lower


def vehicle_status(core: MavlinkCore, now: float, connected: bool) -> LinkStatus:
    """Say whether the vehicle obeys, whether its pose is to be trusted, and what is wrong."""
    distrust, authority = core.pose.faults(now, core.streams.rate(EKF_STATUS)), core.authority
    pose_stamp = core.pose.oldest_part
    if core.options.pose == MOCAP:
        # the EKF's output looks valid for 7 s after its source has stopped: the source's own
        # stamp tells
        pose_stamp = min(pose_stamp, core.mocap.stamp)
    faults = [*distrust, *(f"the vehicle refuses {name}" for name in core.streams.refused())]
    if core.wrong_vehicle:
        faults.append(core.wrong_vehicle)
    if authority.refusal:
        faults.append(": ".join((authority.refusal, *_why_not_armed(core, now))))
    faults += core.others.faults(now)
    fresh = authority.fresh(now)
    ready = authority.obeys and fresh and not core.wrong_vehicle
    # a vehicle that sends poses but no HEARTBEAT is not heard: it may obey us still, so it is
    # braked, not left to a pilot
    heard = core.heard if fresh else authority.heard
    return LinkStatus(
        connected,
        heard,
        pose_stamp,
        ready,
        not distrust,
        authority.armed,
        authority.mode_name,
        tuple(faults),
        core.counters,
        core.frame.doubt,
    )


def _why_not_armed(core: MavlinkCore, now: float) -> tuple[str, ...]:
    said = core.status_texts.refusals(now) if "arm" in core.authority.refusal else ()
    return ("; ".join(said),) if said else ()
