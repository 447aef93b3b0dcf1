"""Inputs of the safety gate that are late, missing or out of bounds, and what follows from it.

The robot slows before an input is too old, and waits for a lost pose where it stands.
"""

from __future__ import annotations

import math

from firmware_bridge.messages import LinkStatus, State, VelocityCommand
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import DRIVING, GateState, Reason

FUTURE = 0.05
"""How far a stamp may lie ahead of the time of a step [s], since another thread took it. A stamp
farther ahead is not trusted."""
GRACE = 1.5
"""Multiple of `pose_age` and `scan_age` at which a late pose or scan is a fault for a robot that
drives: from the age itself on it brakes, and past this it drives on only after `settle`."""


def judge(
    s: GateSettings,
    now: float,
    command: VelocityCommand | None,
    state: State | None,
    status: LinkStatus,
    gate: GateState,
) -> tuple[Reason, ...]:
    """Everything that is wrong with the inputs of a gate in a state."""
    found = []
    if not status.connected:
        found.append(Reason.LINK)
    if not fresh(now, status.heartbeat_stamp, s.heartbeat_age):
        found.append(Reason.HEARTBEAT)
    if not status.ready:
        found.append(Reason.NOT_READY)
    if status.faults:
        found.append(Reason.BOARD)
    if not status.pose_ok:
        found.append(Reason.ESTIMATE)
    # a robot that drives is slowed first, and braked past the limit: a gap is not yet a stop
    oldest = s.pose_age * (GRACE if gate is GateState.ACTIVE else 1.0)
    if state is None or not (
        fresh(now, state.stamp, oldest) and fresh(now, status.pose_stamp, oldest)
    ):
        found.append(Reason.POSE)
    if _blind(s, now, status, gate):
        found.append(Reason.SCAN)
    if state is not None and (where := place(s, state)) is not None:
        found.append(where)
    told = {
        Reason.FRAME: status.frame_doubt,
        Reason.RESTARTED: status.restarted,
        Reason.UNMOVED: status.unmoved,
    }
    found += [reason for reason, wrong in told.items() if wrong]
    if command is None or not fresh(now, command.stamp, s.watchdog):
        found.append(Reason.COMMAND)
    if command is not None and not all(map(math.isfinite, command.speeds)):
        found.append(Reason.COMMAND_INVALID)
    return tuple(found)


def _blind(s: GateSettings, now: float, status: LinkStatus, gate: GateState) -> bool:
    """Whether a robot with a lidar has no fresh scan."""
    oldest = s.scan_age * (GRACE if gate is GateState.ACTIVE else 1.0)
    return status.scan_stamp is not None and not fresh(now, status.scan_stamp, oldest)


def place(s: GateSettings, state: State) -> Reason | None:
    """What is wrong with the robot's pose: not finite, or outside the geofence."""
    if not all(map(math.isfinite, (state.x, state.y, state.theta, state.v, state.omega, state.vy))):
        return Reason.POSE_INVALID
    if s.geofence is not None:
        x_min, y_min, x_max, y_max = s.geofence
        if not (x_min <= state.x <= x_max and y_min <= state.y <= y_max):
            return Reason.GEOFENCE
    return None


def fresh(now: float, stamp: float, limit: float) -> bool:
    """Whether a stamp is young enough; one from the future is not to be trusted. False for NaN."""
    return -FUTURE <= now - stamp <= limit


class Slowing:
    """Slows the robot before pose, scan or command is too old, so that a gap is not yet a stop.

    `settings`: `watchdog`, `pose_age`, `scan_age` and `slow_from` are used. `late_after`: age at
    which a command is late, if later than the settings say [s].
    """

    def __init__(self, settings: GateSettings, late_after: float | None) -> None:
        self._settings = settings
        own = settings.slow_from * settings.watchdog
        self._late = min(max(own, late_after or 0.0), settings.watchdog)

    def share(
        self, now: float, command: VelocityCommand, state: State | None, status: LinkStatus
    ) -> float:
        """Share of its speed limits that the robot may drive now."""
        s = self._settings
        scan = now if status.scan_stamp is None else status.scan_stamp
        pose = min(status.pose_stamp, -math.inf if state is None else state.stamp)
        return min(
            falling(now - pose, s.slow_from * s.pose_age, s.pose_age),
            falling(now - scan, s.slow_from * s.scan_age, s.scan_age),
            falling(now - command.stamp, self._late, s.watchdog),
        )


def falling(age: float, late: float, latest: float) -> float:
    """Fall from 1 at the age `late` to 0 at `latest`.

    Examples
    --------
    >>> [falling(age, 0.25, 0.75) for age in (-0.1, 0.25, 0.5, 0.75, 2.0)]
    [1.0, 1.0, 0.5, 0.0, 0.0]
    """
    if age <= late:
        return 1.0
    return 0.0 if age >= latest else (latest - age) / (latest - late)


POSE_LOST = frozenset({Reason.POSE, Reason.SCAN, Reason.ESTIMATE, Reason.COMMAND})
"""What is wrong when only the pose, or the sight, is lost; there is no new command then either."""


class LostPose:
    """Follows the poses of a robot that drives or has just been stopped.

    `settings`: `resume` and `resume_within` are used.
    """

    def __init__(self, settings: GateSettings) -> None:
        self._settings = settings
        self._pose_only = False
        self._good: tuple[float, float] | None = None

    def strayed(
        self, gate: GateState, state: State | None, status: LinkStatus, reasons: tuple[Reason, ...]
    ) -> bool:
        """Take a step's inputs; tell whether the pose came back too far from where it was lost."""
        if gate not in DRIVING:
            self._pose_only, self._good = False, None
            return False
        # a board that distrusts its estimate reports that as a fault, too
        excused = POSE_LOST if status.pose_ok else POSE_LOST | {Reason.BOARD}
        before = gate is GateState.ACTIVE or self._pose_only
        self._pose_only = before and excused.issuperset(reasons)
        if reasons or state is None:
            return False
        last, self._good = self._good, (state.x, state.y)
        if last is None or not self._settings.resume:
            return False
        return math.dist(last, self._good) > self._settings.resume_within

    def patience(self, final: bool) -> float:
        """How long zeros are sent before the release [s]: longer where only the pose is lost."""
        s = self._settings
        return max(s.hold, s.resume) if self._pose_only and not final else s.hold
