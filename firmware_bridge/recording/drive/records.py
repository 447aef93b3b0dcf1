"""What is recorded of a drive: plain data, cheap to make where it happens, encoded elsewhere.

Times are in seconds on one clock; poses lie in the map's frame, ENU.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from kmpc_lite.control.plan import Plan
from kmpc_lite.types import Array


class PoseSeen(NamedTuple):
    """A pose, as it was measured."""

    time: float
    """When it was true [s]."""
    pose: tuple[float, float, float]
    """x, y [m], theta [rad]."""


class TruePose(NamedTuple):
    """Where the robot really was, which a simulation knows."""

    time: float
    pose: tuple[float, float, float]


class Sent(NamedTuple):
    """A command that went to the robot."""

    time: float
    command: tuple[float, float, float]
    """v [m/s], omega [rad/s], and of an omni its speed to the left [m/s]."""


class Stepped(NamedTuple):
    """A step of the controller: what it was given, and its plan."""

    time: float
    """When the step began [s]."""
    pose: tuple[float, float, float]
    """What it planned from."""
    plan: Plan
    path: Array
    """(K, 2) that guidance follows [m]."""
    margins: Array
    """(N,) of the stages of the plan [m]."""
    circles: Array
    """(M, 5) obstacles: x, y, radius [m], vx, vy [m/s]."""
    pose_age: float | None = None
    """Age of the pose when the step began [s]."""
    scan: Any = None
    """`LaserScan` that it was given."""


class Gate(NamedTuple):
    """The safety gate came to a state, or to other reasons for it."""

    time: float
    state: str
    reasons: tuple[str, ...] = ()


class Health(NamedTuple):
    """State of link and vehicle, now and then."""

    time: float
    values: Mapping[str, Any]
    """What JSON can hold."""


class Note(NamedTuple):
    """Something that a person should read."""

    time: float
    text: str
    bad: bool = False


class Ended(NamedTuple):
    """The drive is over."""

    time: float
    outcome: Mapping[str, Any]
    """What JSON can hold: see `kmpc_lab.recording.simulated`."""


Record = PoseSeen | TruePose | Sent | Stepped | Gate | Health | Note | Ended
