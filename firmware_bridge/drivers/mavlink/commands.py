"""What the vehicle is asked, and when: commands that are sent until they are acknowledged.

Nothing may be asked of it before it accepts our frames. A signed link refuses every frame that is
older than the newest the vehicle has seen. Its clock runs up to a minute ahead of ours, so the
first frames of a new process are refused until we have heard its clock. Were GUIDED asked for
before one of our heartbeats was accepted, the failsafe that still waits for one would choose HOLD
at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.drivers.mavlink.options import GCS, MavlinkOptions
from firmware_bridge.frames import enu_to_ned

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS = range(6)
"""MAV_RESULT; an ArduPilot that cannot arm yet answers FAILED."""
SET_MODE, ARM, PREARM_CHECKS, SET_MESSAGE_INTERVAL = 176, 400, 401, 511  # MAV_CMD
SILENCE = 0.3
"""An acknowledgement that has not come after this long is lost: the command is sent again [s]."""
REFUSED = 1.0  # how long to wait before asking again what was refused for now [s]
SendCommand = Callable[[int, Sequence[float], int], None]
"""Puts a COMMAND_LONG on the wire: command, parameters, confirmation."""
EAGER, CALM = 0.1, 1.0
"""Between heartbeats, before and after one of them is known to be accepted [s]."""
SETTLE = 0.3
"""ArduPilot looks at its failsafes ten times a second: it has seen our heartbeat after this [s]."""
FORGET = 5.0  # without an answer for this long it is not known any more whether we are accepted [s]


class Due:
    """Remembers when each job is due next.

    Examples
    --------
    >>> due = Due()
    >>> due("heartbeat", 5.0, 1.0), due("heartbeat", 5.5, 1.0), due("heartbeat", 6.0, 1.0)
    (True, False, True)
    """

    def __init__(self) -> None:
        self._next: dict[str, float] = {}

    def __call__(self, what: str, now: float, period: float) -> bool:
        """Whether a job is due at `now` [s]; if so, it is due again `period` [s] later."""
        if now < self._next.get(what, -math.inf):
            return False
        self._next[what] = now + period
        return True


@dataclass
class _Request:
    """One command on its way."""

    parameters: tuple[float, ...]
    patient: bool
    due: float
    sent: int = 0
    result: int | None = None


class CommandDesk:
    """Sends one request per command at a time, until it is acknowledged.

    An acknowledgement names only the command, hence one request per command.

    `send`: writes one COMMAND_LONG.
    """

    def __init__(self, send: SendCommand) -> None:
        self._send = send
        self._requests: dict[int, _Request] = {}

    def request(self, command: int, *parameters: float, now: float, patient: bool = False) -> None:
        """Send a request now; it replaces an earlier one of this command.

        A patient request is repeated while it is refused for now, and after it was accepted until
        it is cancelled: what the vehicle says it did and what its heartbeat shows may differ.
        """
        self._requests[command] = _Request(tuple(parameters), patient, now)
        self.tick(now)

    def say(self, command: int, *parameters: float) -> None:
        """Send a command once, without waiting for an acknowledgement."""
        self._send(command, tuple(parameters), 0)

    def cancel(self, command: int) -> None:
        """Forget a request."""
        self._requests.pop(command, None)

    def result(self, command: int) -> int | None:
        """Last answer to the present request, None if there is none."""
        request = self._requests.get(command)
        return None if request is None else request.result

    def tick(self, now: float) -> None:
        """Send what is due."""
        for command, request in self._requests.items():
            if now >= request.due:
                self._send(command, request.parameters, min(request.sent, 255))
                request.sent += 1
                request.due = now + SILENCE

    def on_ack(self, command: int, result: int, now: float) -> bool:
        """Take an acknowledgement; False if no such command was requested."""
        request = self._requests.get(command)
        if request is None or not request.sent:
            return False
        if result == IN_PROGRESS:
            request.due = now + REFUSED
            return True
        request.result = result
        again = request.patient and result in (ACCEPTED, TEMPORARILY_REJECTED, FAILED)
        request.due = now + REFUSED if again else float("inf")
        return True


class Greeting:
    """Concludes from answers: a vehicle that answers a question accepts it, and all sent later."""

    def __init__(self) -> None:
        self._answered = -math.inf
        self._accepted: float | None = None
        """When the first heartbeat went out that must have been accepted [s]."""
        self._first: float | None = None

    @property
    def answered(self) -> bool:
        """Whether the vehicle has ever answered."""
        return math.isfinite(self._answered)

    def on_answer(self, now: float) -> None:
        """Note an answer to a question of ours."""
        if self._first is None or now - self._answered > FORGET:
            self._first, self._accepted = now, None
        self._answered = now

    def on_heartbeat_sent(self, now: float) -> None:
        """Note a heartbeat of ours."""
        if self._first is not None and self._accepted is None and now > self._first:
            self._accepted = now

    def done(self, now: float) -> bool:
        """Whether a heartbeat of ours was accepted, and the failsafe has had time to see it."""
        fresh = now - self._answered <= FORGET
        return fresh and self._accepted is not None and now - self._accepted >= SETTLE

    def period(self, now: float) -> float:
        """Time between heartbeats [s]."""
        return CALM if self.done(now) else EAGER


BODY_NED = 8
VELOCITY_AND_YAW_RATE = 0x5C7
"""Type mask: position, acceleration and yaw ignored; with one of vx, vy ignored as well ArduPilot
would drop both."""
MONOTONIC_MS = 2**32


class MessageBuilder:
    """Messages to one vehicle.

    `options`: ids of the vehicle, and ours.
    """

    def __init__(self, options: MavlinkOptions) -> None:
        self._to = (options.system, options.component)
        self._type = (
            dialect.MAV_TYPE_GCS if options.role == GCS else dialect.MAV_TYPE_ONBOARD_CONTROLLER
        )

    def heartbeat(self) -> Any:
        """HEARTBEAT of ours."""
        return dialect.MAVLink_heartbeat_message(
            self._type, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
        )

    def set_point(self, v: float, omega: float, now: float) -> Any:
        """Speed along the nose [m/s] and turn rate, counter-clockwise [rad/s], both finite.

        A NaN speed makes ArduPilot abort; here is the last check against one.
        """
        if not (math.isfinite(v) and math.isfinite(omega)):
            raise ValueError(
                f"expected a finite speed and turn rate, got {v!r} m/s, {omega!r} rad/s"
            )
        boot_ms = int(now * 1000.0) % MONOTONIC_MS
        rest = (0.0,) * 6
        return dialect.MAVLink_set_position_target_local_ned_message(
            boot_ms,
            *self._to,
            BODY_NED,
            VELOCITY_AND_YAW_RATE,
            0.0,
            0.0,
            0.0,
            float(v),
            *rest,
            0.0 - float(omega),
        )

    def command(self, command: int, parameters: Sequence[float], confirmation: int) -> Any:
        """COMMAND_LONG; missing parameters are 0."""
        values = [float(p) for p in parameters] + [0.0] * (7 - len(parameters))
        return dialect.MAVLink_command_long_message(*self._to, command, confirmation, *values)

    def timesync(self, tc1: int, ts1: int) -> Any:
        """A request where tc1 is 0, else the reply to one [ns]."""
        return dialect.MAVLink_timesync_message(tc1, ts1)

    def vision(self, x: float, y: float, theta: float, stamp: float) -> Any:
        """A pose of ours (ENU) at our time as VISION_POSITION_ESTIMATE, level and at height 0."""
        north, east, yaw = enu_to_ned(x, y, theta)
        return dialect.MAVLink_vision_position_estimate_message(
            int(stamp * 1e6), north, east, 0.0, 0.0, 0.0, yaw
        )

    def origin(self, latitude: float, longitude: float, altitude: float) -> Any:
        """SET_GPS_GLOBAL_ORIGIN [deg, deg, m]."""
        place = round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3)
        return dialect.MAVLink_set_gps_global_origin_message(self._to[0], *place)

    def parameter_read(self, name: str) -> Any:
        """PARAM_REQUEST_READ by name."""
        return dialect.MAVLink_param_request_read_message(*self._to, name.encode(), -1)

    def parameter_set(self, name: str, value: float, kind: int) -> Any:
        """PARAM_SET."""
        return dialect.MAVLink_param_set_message(*self._to, name.encode(), value, kind)
