"""Poses from outside, motion capture for one: a datagram each, checked, brought to our clock."""

from __future__ import annotations

import json
import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from firmware_bridge.drivers import Driver
from firmware_bridge.link.sockets import UdpEndpoint
from firmware_bridge.link.threaded import ThreadedTransport
from firmware_bridge.link.url import LinkUrl
from firmware_bridge.messages import ConfigError, LinkStatus, State
from firmware_bridge.sensors.sensor_driver import SensorDriver

LONGEST = 512  # a datagram longer than this is no pose [bytes]
WINDOW = 10.0  # the shortest way from the source to us is looked for among the poses of so long [s]
RESTART = 1.0
"""A stamp that runs back, or ahead of ours, by more than this comes from a clock that was set anew
[s]."""
RESTARTS, STEADY = 2, 10.0
"""A source's clock may be set anew so often within this time [s]: each time the age of its poses
begins at nothing. One that jumps on is not believed until it has been steady for as long."""
SLACK, FASTEST = 0.15, 3.0
"""A pose farther from the last than `SLACK` [m] and `FASTEST` [m/s] allow is a jump: exchanged
markers, or a robot that is carried."""
TURN_SLACK, TURN_FASTEST = 0.5, 10.0  # the same of the heading [rad, rad/s]
FARTHEST = 1e5  # positions beyond this are no robot's [m]
SETTLED = 0.5
"""Poses that agree with one another for so long are believed again, wherever they are [s]; by then
the gate has stopped the robot."""
SILENCE = 0.25  # a longer gap between poses is counted [s]
TOLD = 1.0  # how long non-finite numbers of a source are reported [s]
KEYS = ("stamp", "x", "y", "theta")
COUNTERS = (
    "poses",
    "malformed",
    "not_finite",
    "out_of_order",
    "jumps",
    "clock_jumps",
    "unsteady",
    "silences",
    "refused_by_driver",
)


class SourcePose(NamedTuple):
    """Pose of the robot: x east, y north [m], theta counter-clockwise from east [rad], time [s]."""

    x: float
    y: float
    theta: float
    stamp: float


def parse_pose(data: bytes) -> SourcePose | None:
    """Read ``stamp x y theta``, divided by blanks or commas, or a JSON object; None for all else.

    Examples
    --------
    >>> parse_pose(b"12.5 1.0 -2.0 0.7")
    SourcePose(x=1.0, y=-2.0, theta=0.7, stamp=12.5)
    >>> parse_pose(b'{"stamp": 12.5, "x": 1, "y": -2, "theta": 0.7}')
    SourcePose(x=1.0, y=-2.0, theta=0.7, stamp=12.5)
    >>> parse_pose(b"1.0 2.0")
    """
    if len(data) > LONGEST:
        return None
    try:
        text = data.decode("ascii").strip()
        if text.startswith("{"):
            table = json.loads(text)
            values = [table[key] for key in KEYS]
            if any(
                isinstance(value, bool) or not isinstance(value, int | float) for value in values
            ):
                return None
            numbers = [float(value) for value in values]
        else:
            numbers = [float(word) for word in text.replace(",", " ").split()]
        stamp, x, y, theta = numbers
    except (ValueError, KeyError, OverflowError, RecursionError):
        return None
    return SourcePose(x, y, theta, stamp)


class PoseFilter:
    """Believes or refuses what a source says, on the times it is given; counts what it refuses.

    The source's clock may be any: the shortest way seen counts as none, so that a pose that waited
    on the way is known by its age.
    """

    def __init__(self) -> None:
        self.counters = dict.fromkeys(COUNTERS, 0)
        self.latest: SourcePose | None = None  # newest that is believed, stamped with our clock
        self._heard: float | None = None
        self._nonsense = -math.inf  # when it last sent non-finite numbers [s]
        self._source_stamp = -math.inf
        self._restarts: deque[float] = deque(maxlen=RESTARTS + 1)
        """When its clock was last set anew [s]."""
        self._ways: deque[tuple[float, float]] = deque()
        """Arrival [s] and arrival minus stamp [s], growing from the shortest of the window on."""
        self._doubted: SourcePose | None = None
        self._doubted_since = 0.0

    def take(self, data: bytes, now: float) -> SourcePose | None:
        """Take a datagram that came at `now` [s]; gives its pose if credible. Never raises."""
        said = parse_pose(data)
        if said is None:
            self.counters["malformed"] += 1
            return None
        return self.believe(said, now)

    def believe(self, said: SourcePose, now: float) -> SourcePose | None:
        """Take a pose with the source's stamp that came at `now` [s]; gives it if credible."""
        if not all(map(math.isfinite, said)) or max(abs(said.x), abs(said.y)) > FARTHEST:
            self.counters["not_finite"] += 1
            self._nonsense = now
            return None
        if self._heard is not None and now - self._heard > SILENCE:
            self.counters["silences"] += 1
        self._heard = now
        pose = self._on_our_clock(said, now)
        if pose is None or (self.latest is not None and pose.stamp <= self.latest.stamp):
            self.counters["out_of_order"] += 1
            return None
        if self.fault(now):
            self.counters["unsteady"] += 1
            return None
        if self.latest is not None and _jumps(self.latest, pose) and not self._settled(pose):
            self.counters["jumps"] += 1
            return None
        self._doubted, self.latest = None, pose
        self.counters["poses"] += 1
        return pose

    def _on_our_clock(self, said: SourcePose, now: float) -> SourcePose | None:
        """Stamp it with our clock; None for one that is overtaken."""
        way = now - said.stamp
        if said.stamp < self._source_stamp - RESTART or (
            self._ways and way < self._ways[0][1] - RESTART
        ):
            self.counters["clock_jumps"] += 1
            self._restarts.append(now)
            self._ways.clear()
        elif said.stamp <= self._source_stamp:
            return None
        self._source_stamp = said.stamp
        while self._ways and self._ways[-1][1] >= way:
            self._ways.pop()
        self._ways.append((now, way))
        while self._ways[0][0] < now - WINDOW:
            self._ways.popleft()
        return said._replace(stamp=min(now, said.stamp + self._ways[0][1]))

    @property
    def shortest_way(self) -> float:
        """Arrival minus stamp of the pose that came fastest lately [s]; NaN before the first."""
        ways = tuple(self._ways)  # a copy, since the source's thread changes it
        return ways[0][1] if ways else math.nan

    def nonsense(self, now: float) -> str:
        """Say that poses come of which none is a number; empty if that is not so."""
        since = self._nonsense - (-math.inf if self._heard is None else self._heard)
        if now - self._nonsense > TOLD or not since > SILENCE:
            return ""
        return (
            f"the pose source sends non-finite numbers, or positions beyond {FARTHEST / 1e3:g} km"
        )

    def fault(self, now: float) -> str:
        """Why nothing is believed now, empty if that is not so."""
        recent = sum(now - at < STEADY for at in tuple(self._restarts))
        if recent <= RESTARTS:
            return ""
        return f"the clock of the pose source jumps: its poses are rejected for {STEADY:g} s"

    def _settled(self, pose: SourcePose) -> bool:
        """Whether poses elsewhere have agreed with one another for long enough."""
        if self._doubted is None or _jumps(self._doubted, pose):
            self._doubted_since = pose.stamp
        self._doubted = pose
        return pose.stamp - self._doubted_since >= SETTLED


def _jumps(before: SourcePose, after: SourcePose) -> bool:
    """Whether no robot goes from one pose to the other in that time."""
    seconds = after.stamp - before.stamp
    turn = abs(math.remainder(after.theta - before.theta, math.tau))
    too_far = math.hypot(after.x - before.x, after.y - before.y) > SLACK + FASTEST * seconds
    return too_far or turn > TURN_SLACK + TURN_FASTEST * seconds


def check_pose_url(url: str) -> LinkUrl:
    """Take the URL of a source apart; ConfigError for any but udp:HOST:PORT."""
    link = LinkUrl.parse(url)
    if link.kind != "udp":
        raise ConfigError(f"pose: expected udp:HOST:PORT, got {url!r}")
    link.allow()
    link.address()
    return link


class PosedDriver(SensorDriver):
    """A driver whose pose comes from another source.

    An autopilot is fed with that pose; otherwise it replaces the odometry.

    `driver`: not yet connected. `url`: udp:HOST:PORT, where the datagrams arrive; of several
    senders the first is heard, until it is silent for a second. `feed`: the driver's `feed_pose`,
    for an autopilot that has an estimate of its own.
    """

    def __init__(
        self,
        driver: Driver,
        url: str,
        feed: Callable[[float, float, float, float], None] | None = None,
    ) -> None:
        super().__init__(driver)
        self._feed, self._filter = feed, PoseFilter()
        self._endpoint = UdpEndpoint(*check_pose_url(url).address(), listen=True)
        self._transport = ThreadedTransport(self._endpoint)

    def connect(self, timeout: float) -> None:
        """Listen to the source, then connect the driver."""
        try:
            self._transport.start(self._on_datagram)
            self.inner.connect(timeout)
        except BaseException:
            self._transport.close()
            raise

    def state(self) -> State | None:
        """Newest pose, with the driver's own speeds."""
        state, pose = self.inner.state(), self._filter.latest
        if self._feed is not None or state is None:
            return state
        return (
            None
            if pose is None
            else replace(state, x=pose.x, y=pose.y, theta=pose.theta, stamp=pose.stamp)
        )

    def health(self) -> LinkStatus:
        """Status of the board with the age of the source's pose; an echo of it may be newer."""
        status, pose = self.inner.health(), self._filter.latest
        counters = {f"source_{name}": count for name, count in self._filter.counters.items()}
        others = {"source_others": self._endpoint.refused}
        stamp = -math.inf if pose is None else pose.stamp
        # an autopilot's own word counts too: its position may be older than what it was fed
        stamp = min(stamp, status.pose_stamp) if self._feed is not None else stamp
        now = time.monotonic()
        fault = self._filter.fault(now) or self._filter.nonsense(now)
        return replace(
            status,
            pose_stamp=stamp,
            faults=(*status.faults, fault) if fault else status.faults,
            counters={**status.counters, **counters, **others},
        )

    def close(self) -> None:
        """Close the driver, then the source, of which its last stop may have need."""
        self.inner.close()
        self._transport.close()

    def _on_datagram(self, data: bytes, stamp: float) -> None:
        pose = self._filter.take(data, stamp)
        if pose is None or self._feed is None:
            return
        try:
            self._feed(*pose)
        except Exception:  # whatever a driver raises, the source's thread goes on
            self._filter.counters["refused_by_driver"] += 1
