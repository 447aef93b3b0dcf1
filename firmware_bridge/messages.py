"""What travels through the bridge: frozen, SI units, ENU frame, monotonic stamps."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

Speeds = tuple[float, float, float]  # v [m/s], omega [rad/s], and an omni's vy [m/s]
STILL: Speeds = (0.0, 0.0, 0.0)


class BridgeError(Exception):
    """Base of every error that the bridge raises on purpose; one line that a user can act on."""


class LinkError(BridgeError, OSError):
    """A link cannot be opened, or its other end does not answer."""


class LidarError(LinkError):
    """The robot's lidar cannot be opened, or gives no scan."""


class ConfigError(BridgeError, ValueError):
    """A robot file, a link URL or an option is wrong: key, what was expected, what came."""


@dataclass(frozen=True)
class State:
    """Where the robot is: ENU (x east, y north), theta counter-clockwise from east."""

    x: float  # [m]
    y: float  # [m]
    theta: float  # [rad]
    v: float  # forward speed [m/s]
    omega: float  # turn rate, counter-clockwise [rad/s]
    stamp: float  # `time.monotonic()` at which this was true, as well as is known [s]
    vy: float = 0.0  # speed to the left of an omni [m/s]


@dataclass(frozen=True)
class VelocityCommand:
    """What the controller wants."""

    v: float  # [m/s]
    omega: float  # [rad/s], counter-clockwise
    stamp: float  # `time.monotonic()` at which it was computed [s]
    vy: float = 0.0  # of an omni, to the left [m/s]

    @property
    def speeds(self) -> Speeds:
        """All of them."""
        return self.v, self.omega, self.vy


@dataclass(frozen=True)
class LinkStatus:
    """What a driver knows of the other end; stamps are `time.monotonic()`, -inf for never."""

    connected: bool  # whether the transport is open
    heartbeat_stamp: float  # when the board was last heard
    pose_stamp: float
    """When the source of the pose last gave one: for motion capture the source itself, not the
    autopilot's echo."""
    ready: bool
    """Whether the board obeys our commands now: armed and in the mode we need; always true for
    plain motor controllers."""
    pose_ok: bool = True
    """Whether the board trusts its own estimate (EKF flags, valid encoder estimates)."""
    armed: bool = True
    mode: str = ""  # the board's own word for its mode
    faults: tuple[str, ...] = ()  # standing errors in words: over-temperature, encoder lost, ...
    counters: Mapping[str, int] = field(default_factory=dict)
    """bytes, frames, bad CRCs, resynchronisations, refused messages, reconnects, ..."""
    frame_doubt: str = ""  # why the board's frame may have moved, in words; else empty
    restarted: bool = False
    """Whether the board was switched off and on lately: how far the robot rolled is not known."""
    unmoved: str = ""  # the commanded motion that did not happen, in words; else empty
    scan_stamp: float | None = None
    """When the newest scan of the robot's lidar was measured; None for a robot without one."""
    scan_faults: tuple[str, ...] = ()  # why no scans come, in words

    @property
    def lost(self) -> int:
        """How many frames were bad, dropped or refused, and how often the link was."""
        kinds = ("bad", "drop", "refused", "reconn")
        return sum(n for name, n in self.counters.items() if name.startswith(kinds))


def speeds_of(command: Iterable[float]) -> Speeds:
    """Take a controller's command for speeds: (v, omega), or an omni's (v_x, v_y, omega)."""
    v, *left, omega = map(float, command)
    return v, omega, left[0] if left else 0.0


def command_of(speeds: Speeds | None, inputs: int) -> tuple[float, ...]:
    """Give speeds as a controller's command of so many numbers; NaN if they are not known.

    Examples
    --------
    >>> command_of((0.3, 1.0, 0.1), 3), command_of((0.3, 1.0, 0.0), 2)
    ((0.3, 0.1, 1.0), (0.3, 1.0))
    """
    if speeds is None:
        return (math.nan,) * inputs
    v, omega, vy = speeds
    return (v, vy, omega) if inputs == 3 else (v, omega)


Controller = Callable[[State], VelocityCommand]  # all that the bridge knows of a controller
