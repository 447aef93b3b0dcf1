"""What is wrong with the inputs of the safety gate: late, missing, not finite, out of bounds."""

from __future__ import annotations

import math

from firmware_bridge.messages import LinkStatus, State, VelocityCommand
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import GateState, Reason

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
    if command is not None and not (math.isfinite(command.v) and math.isfinite(command.omega)):
        found.append(Reason.COMMAND_INVALID)
    return tuple(found)


def _blind(s: GateSettings, now: float, status: LinkStatus, gate: GateState) -> bool:
    """Whether a robot with a lidar has no fresh scan."""
    oldest = s.scan_age * (GRACE if gate is GateState.ACTIVE else 1.0)
    return status.scan_stamp is not None and not fresh(now, status.scan_stamp, oldest)


def place(s: GateSettings, state: State) -> Reason | None:
    """What is wrong with the robot's pose: not finite, or outside the geofence."""
    if not all(map(math.isfinite, (state.x, state.y, state.theta, state.v, state.omega))):
        return Reason.POSE_INVALID
    if s.geofence is not None:
        x_min, y_min, x_max, y_max = s.geofence
        if not (x_min <= state.x <= x_max and y_min <= state.y <= y_max):
            return Reason.GEOFENCE
    return None


def fresh(now: float, stamp: float, limit: float) -> bool:
    """Whether a stamp is young enough; one from the future is not to be trusted. False for NaN."""
    return -FUTURE <= now - stamp <= limit
