"""A State from LOCAL_POSITION_NED and ATTITUDE, and whether estimate and origin can be trusted.

EKF_STATUS_REPORT says whether to trust the estimate. After a restart the autopilot sets a new
origin where it then stands; another station may set one, too. Poses look as good as before, but the
map is shifted: nothing may move until a person has looked. Poses of motion capture go the other
way, after the origin that the autopilot needs once.

Texts of the autopilot come in chunks, and are put together here.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from firmware_bridge.drivers.mavlink.commands import MessageBuilder
from firmware_bridge.drivers.mavlink.options import MOCAP, MavlinkOptions
from firmware_bridge.frames import forward_speed, ned_to_enu
from firmware_bridge.messages import LinkStatus, State

if TYPE_CHECKING:
    from firmware_bridge.drivers.mavlink.core import MavlinkCore

ATTITUDE, VELOCITY_HORIZ, POS_HORIZ_REL, POS_HORIZ_ABS = 1, 2, 8, 16
CONST_POS_MODE, UNINITIALIZED, GPS_GLITCHING = 128, 1024, 32768  # flags of EKF_STATUS_REPORT
EKF_AGE = 0.25  # how old the flags may be [s]
PAIR = 0.2  # how far apart a position and the attitude used with it may be [s]
MISSING, TOLD = 0.25, 1.0
"""How long refused poses are reported [s], after this time without a good one [s]."""
FARTHEST, FASTEST = 1e5, 100.0  # positions [m] and speeds [m/s, rad/s] beyond these are no rover's
ORIGIN_MOVES = 10  # an origin that moves by more than this is another one [1e-7 degrees]: 0.1 m
FUTURE = 0.05  # a stamp may lie this far ahead of the time at which it is given [s]
PERIOD = 0.02
"""Least time between poses that are passed on [s]: a serial link has no room for all poses of a
faster motion capture."""


class PoseTracker:
    """Pairs positions with attitudes, refuses impossible ones, and judges the EKF by its flags."""

    def __init__(self) -> None:
        self.state: State | None = None
        self.oldest_part = -math.inf
        """When the older of the position and the attitude behind `state` was true [s]."""
        self.flags: int | None = None
        self.refused = 0  # messages refused for impossible values
        self.unpaired = 0  # positions without an attitude near them in time
        self._flags_stamp = self._refused_at = -math.inf
        self._attitude: tuple[float, float, float] | None = None

    def on_attitude(self, message: Any, stamp: float) -> None:
        """Keep the newest yaw and yaw rate (NED)."""
        if self._sane((message.yaw, message.yawspeed), FASTEST, stamp):
            self._attitude = (stamp, message.yaw, message.yawspeed)

    def on_position(self, message: Any, stamp: float) -> None:
        """Make a state of the newest position and the attitude, brought to the same time."""
        place, speed = (message.x, message.y), (message.vx, message.vy)
        if not (self._sane(place, FARTHEST, stamp) and self._sane(speed, FASTEST, stamp)):
            return
        if self._attitude is None or abs(stamp - self._attitude[0]) > PAIR:
            self.unpaired += 1
            return
        at, yaw, yaw_rate = self._attitude
        yaw += (stamp - at) * yaw_rate
        x, y, theta = ned_to_enu(message.x, message.y, yaw)
        self.state = State(
            x, y, theta, forward_speed(message.vx, message.vy, yaw), 0.0 - yaw_rate, stamp
        )
        self.oldest_part = min(stamp, at)

    def on_ekf(self, flags: int, now: float) -> None:
        """Keep the EKF's flags."""
        self.flags, self._flags_stamp = flags, now

    def faults(self, now: float, rate: float) -> tuple[str, ...]:
        """Why the estimate is not to be trusted; `rate` is how often the flags should come [Hz]."""
        if self.flags is None or now - self._flags_stamp > max(EKF_AGE, 3.0 / rate):
            return ("EKF: no status report",)
        missing = [
            (not self.flags & ATTITUDE, "no attitude"),
            (not self.flags & VELOCITY_HORIZ, "no horizontal velocity"),
            (not self.flags & (POS_HORIZ_REL | POS_HORIZ_ABS), "no horizontal position"),
            (bool(self.flags & CONST_POS_MODE), "position held constant"),
            (bool(self.flags & UNINITIALIZED), "not initialised"),
            (bool(self.flags & GPS_GLITCHING), "GPS glitch"),
        ]
        return tuple(f"EKF: {text}" for wrong, text in missing if wrong) + self._nonsense(now)

    def _nonsense(self, now: float) -> tuple[str, ...]:
        """Say that poses come of which none is a number."""
        last = -math.inf if self.state is None else self.state.stamp
        if now - self._refused_at > TOLD or not self._refused_at - last > MISSING:
            return ()
        return ("the autopilot sends poses that are no numbers, or impossible ones",)

    def _sane(self, values: tuple[float, ...], limit: float, stamp: float) -> bool:
        """Whether all are numbers within the limit; counted if not."""
        good = all(math.isfinite(value) and abs(value) <= limit for value in values)
        if not good:
            self.refused += 1
            self._refused_at = stamp
        return good


class FrameWatch:
    """Doubts the frame after a restart or a jump of clock or origin, until it is confirmed."""

    def __init__(self) -> None:
        self.doubt = ""  # why the frame may have moved, empty if nothing says so
        self.doubts = 0  # how often the frame was doubted
        self._resets = 0
        self._origin: tuple[int, int] | None = None

    def on_clock(self, resets: int) -> None:
        """Take how often the vehicle's clock has begun anew."""
        if resets != self._resets:
            self._resets = resets
            self._doubt("the autopilot was restarted, or its clock jumped")

    def on_origin(self, latitude: int, longitude: int) -> None:
        """Take where the vehicle says its origin is [1e-7 degrees]."""
        before, self._origin = self._origin, (latitude, longitude)
        if (
            before is not None
            and max(abs(a - b) for a, b in zip(before, self._origin, strict=True)) > ORIGIN_MOVES
        ):
            self._doubt("the autopilot's origin has moved")

    def confirm(self) -> None:
        """Trust the frame again, after it was checked on the map."""
        self.doubt = ""

    def _doubt(self, why: str) -> None:
        self.doubt, self.doubts = why, self.doubts + 1


class MocapFeed:
    """Passes poses on, and refuses bad ones.

    `options`: whether there is motion capture, and the origin. `build`: builds messages to the
    vehicle. `send`: takes a message to put on the wire.
    """

    def __init__(
        self, options: MavlinkOptions, build: MessageBuilder, send: Callable[[Any], None]
    ) -> None:
        self._options, self._build, self._send = options, build, send
        self.stamp = -math.inf  # stamp of the newest pose [s]
        self.refused = 0
        self.has_origin = False  # whether the vehicle has an origin
        self._sent = -math.inf

    def feed(self, x: float, y: float, theta: float, stamp: float, now: float) -> None:
        """Pass a pose on; bad ones are refused and counted.

        Bad is what is not finite, from the future, or not newer than the last.
        """
        finite = all(map(math.isfinite, (x, y, theta, stamp)))
        if not finite or stamp > now + FUTURE or stamp <= self.stamp:
            self.refused += 1
            return
        self.stamp = stamp
        if stamp - self._sent >= PERIOD * 0.9:
            self._sent = stamp
            self._send(self._build.vision(x, y, theta, stamp))

    @property
    def wants_origin(self) -> bool:
        """Whether the vehicle is to be given an origin that it has not."""
        options = self._options
        return options.pose == MOCAP and options.origin is not None and not self.has_origin

    def send_origin(self) -> None:
        """Give the vehicle its origin."""
        assert self._options.origin is not None
        self._send(self._build.origin(*self._options.origin))


CHUNK = 50  # characters of one STATUSTEXT; longer texts come in several
PATIENCE = 1.0  # time after which a text with missing chunks is given out as far as it has come [s]
KEPT = 20  # texts that are remembered of each sort: whole, in chunks, and reasons for not arming
FRESH = 35.0  # oldest reason for not arming that still counts [s]: ArduPilot repeats it every 30 s
AT_ONCE = 1.5  # ArduPilot sends all its reasons for not arming within this time [s]
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
    distrust, authority = core.distrust(now), core.authority
    pose_stamp = core.pose.oldest_part
    if core.options.pose == MOCAP:
        # the EKF's output looks valid for 7 s after its source has stopped: the source's own
        # stamp tells
        pose_stamp = min(pose_stamp, core.mocap.stamp)
    faults = [*distrust, *(f"the vehicle refuses {name}" for name in core.streams.refused())]
    if core.wrong_vehicle:
        faults.append(core.wrong_vehicle)
    if authority.refusal:
        why = core.status_texts.refusals(now) if "arm" in authority.refusal else ()
        faults.append(": ".join(filter(None, (authority.refusal, "; ".join(why)))))
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
