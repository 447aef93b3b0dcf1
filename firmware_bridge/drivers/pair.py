"""Two boards of one kind: the first drives an omni's front wheels, the second its rear wheels.

Each is driven as the board of a robot of two wheels; what the four do together is worked out here.
"""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from firmware_bridge.drivers import Driver
from firmware_bridge.drivers.motor_board import geometry_of
from firmware_bridge.kinematics import OmniGeometry, WheelGeometry
from firmware_bridge.messages import ConfigError, LinkStatus, State
from firmware_bridge.odometry import WheelOdometry

ENDS = "front", "rear"


def omni_of(table: Mapping[str, Any]) -> OmniGeometry:
    """Four mecanum wheels of a robot file's table; ConfigError for any others."""
    whole = geometry_of(table)
    if not isinstance(whole, OmniGeometry) or whole.arm is not None:
        raise ConfigError("link.second: two boards drive four mecanum wheels: track and wheelbase")
    return whole


def halves(table: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Tables of both boards, front and rear, from an omni's; ConfigError names what is missing."""
    whole = omni_of(table)
    same = {key: getattr(whole, key) for key in ("wheel_radius", "max_wheel_speed", "gear_ratio")}
    front, rear = (
        {
            "board": table.get("board", {}),
            "geometry": {
                **same,
                "track": whole.track,
                "invert_left": first in whole.invert,
                "invert_right": first + 1 in whole.invert,
            },
        }
        for first in (1, 3)
    )
    return front, rear


@dataclass
class End:
    """How far the wheels of one board have turned, from its odometry as a robot of two wheels."""

    geometry: WheelGeometry
    state: State | None = None
    way: float = 0.0
    """Mean of both rims [m]."""
    turn: float = 0.0
    """Difference of both rims over the track [rad]."""

    def take(self, state: State | None) -> None:
        """Take in its newest state."""
        before, self.state = self.state, state
        if before is None or state is None or before.stamp == state.stamp:
            return
        turn = math.remainder(state.theta - before.theta, math.tau)
        middle, half = before.theta + 0.5 * turn, 0.5 * turn
        dx, dy = state.x - before.x, state.y - before.y
        chord = math.sin(half) / half if abs(half) > 1e-6 else 1.0
        self.way += (dx * math.cos(middle) + dy * math.sin(middle)) / chord
        self.turn += turn

    def wheels(self, at: float) -> tuple[float, ...]:
        """How far its wheels have turned [rad] at a time [s] that is near its state's."""
        assert self.state is not None
        since = at - self.state.stamp
        way, turn = self.way + since * self.state.v, self.turn + since * self.state.omega
        rims = way - 0.5 * turn * self.geometry.track, way + 0.5 * turn * self.geometry.track
        return tuple(rim / self.geometry.wheel_radius for rim in rims)


class PairDriver:
    """A `Driver` of two.

    Parameters
    ----------
    boards : tuple of Driver
        Front and rear, built from `halves`.
    table : mapping
        Of the whole robot.
    """

    def __init__(self, boards: tuple[Driver, Driver], table: Mapping[str, Any]) -> None:
        self._boards, self._geometry = boards, omni_of(table)
        self._ends = tuple(End(WheelGeometry(**half["geometry"])) for half in halves(table))
        # its wheels are those of the boards, whose signs and gears are theirs
        plain = replace(self._geometry, invert=(), gear_ratio=1.0)
        self._plain, self._odometry = plain, WheelOdometry(plain, 1.0, wraps=False)
        self._lock = threading.Lock()
        self._state: State | None = None

    def connect(self, timeout: float) -> None:
        """Open both links; LinkError if one board does not answer."""
        try:
            for board in self._boards:
                board.connect(timeout)
        except BaseException:
            self.close()
            raise
        self.state()  # from here on it is known how far the wheels turn

    def state(self) -> State | None:
        """Newest odometry of all four wheels, at a time that both boards have told of."""
        with self._lock:
            for end, board in zip(self._ends, self._boards, strict=True):
                end.take(board.state())
            states = [end.state for end in self._ends]
            if None in states:
                return None
            at = min(state.stamp for state in states if state is not None)
            if self._state is not None and at <= self._state.stamp:
                return self._state
            wheels = tuple(wheel for end in self._ends for wheel in end.wheels(at))
            self._odometry.update(self._plain.to_channels(*wheels), at)
            here = self._odometry
            v, omega, vy = self._plain.body(self._speeds())
            self._state = State(here.x, here.y, here.theta, v, omega, at, vy)
            return self._state

    def _speeds(self) -> tuple[float, ...]:
        """Of the four wheels [rad/s]."""
        known = [(end, end.state) for end in self._ends if end.state is not None]
        return tuple(w for end, s in known for w in end.geometry.wheels(s.v, s.omega))

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        """Command speeds; ValueError before any byte is written if one is not finite."""
        wheels = self._geometry.wheels(v, omega, vy)
        for k, (end, board) in enumerate(zip(self._ends, self._boards, strict=True)):
            ahead, turn, _ = end.geometry.body(wheels[2 * k : 2 * k + 2])
            board.send(ahead, turn)

    def stop(self) -> None:
        """Zero speed, then release the motors."""
        for board in self._boards:
            board.stop()

    def health(self) -> LinkStatus:
        """What is known of both: the worse of each."""
        told = [board.health() for board in self._boards]
        named = list(zip(ENDS, told, strict=True))
        counters: Counter[str] = Counter()
        for one in told:
            counters.update(one.counters)
        return LinkStatus(
            connected=all(one.connected for one in told),
            heartbeat_stamp=min(one.heartbeat_stamp for one in told),
            pose_stamp=min(one.pose_stamp for one in told),
            ready=all(one.ready for one in told),
            pose_ok=all(one.pose_ok for one in told),
            armed=all(one.armed for one in told),
            mode="; ".join(f"{end}: {one.mode}" for end, one in named if one.mode),
            faults=tuple(f"{end}: {fault}" for end, one in named for fault in one.faults),
            restarted=any(one.restarted for one in told),
            counters=counters,
        )

    def close(self) -> None:
        """Close both links; idempotent."""
        for board in self._boards:
            board.close()
