"""VESCs over one UART (bldc's commands.c): two, the second through CAN, or a car's with a servo."""

from __future__ import annotations

import math
import struct
from collections.abc import Hashable
from dataclasses import dataclass

from firmware_bridge.drivers.polled import NoReply, PolledDriver
from firmware_bridge.drivers.polled.options import PolledOptions, servo_position
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link import Transport
from firmware_bridge.link.framing import VescPackets, vesc_packet
from firmware_bridge.messages import ConfigError
from firmware_bridge.odometry import WheelOdometry
from firmware_bridge.options import bounded

FW_VERSION = 0
GET_VALUES = 4
SET_CURRENT = 6
SET_BRAKE = 7
SET_RPM = 8
SET_SERVO_POS = 12
ALIVE = 30
FORWARD_CAN = 34
GET_SELECTIVE = 50
MASK = 1 << 7 | 1 << 13 | 1 << 15 | 1 << 17  # rpm, tachometer, fault, controller id
SELECTIVE = struct.Struct(">BIiiBB")  # command, mask, rpm, tachometer, fault, controller id
VALUES = struct.Struct(">BhhiiiihihiiiiiiBiB")  # the whole of GET_VALUES up to the controller id
VALUES_RPM, VALUES_TACHO, VALUES_FAULT, VALUES_ID = 8, 14, 16, 18
STEPS_PER_ELECTRIC_TURN = 6
MAX_PAYLOAD = 128  # the longest answer that the driver asks for has about 75 bytes
FAULTS = (
    "",
    "over-voltage",
    "under-voltage",
    "gate driver",
    "over-current",
    "over-temperature of the bridge",
    "over-temperature of the motor",
    "gate driver over-voltage",
    "gate driver under-voltage",
    "processor under-voltage",
    "restarted by its own watchdog",
    "encoder SPI",
    "encoder sin/cos too small",
    "encoder sin/cos too large",
    "flash corrupted",
    "offset of current sensor 1",
    "offset of current sensor 2",
    "offset of current sensor 3",
    "unbalanced currents",
    "brake",
    "resolver lost tracking",
    "resolver degraded",
    "resolver lost",
    "application settings corrupted",
    "motor settings corrupted",
    "encoder without magnet",
    "encoder magnet too strong",
    "phase filter",
    "encoder",
    "low-voltage output",
)
ENCODER_FAULTS = frozenset({11, 12, 13, 20, 21, 22, 25, 26, 28})


@dataclass(frozen=True, kw_only=True)
class VescOptions(PolledOptions):
    """The ``[board]`` section of a robot file."""

    can_id: int | None = bounded(0, 253, "", None)
    """Of the second VESC, as VESC Tool shows it; the first is the one on the UART. A car has none.
    """
    pole_pairs: int = bounded(1, 200)  # of the motors
    servo_straight: float = bounded(0.0, 1.0, "", 0.5)
    """Position of a car's servo that steers straight ..."""
    servo_left: float = bounded(0.0, 1.0, "", 0.9)
    """... and of the largest steering angle, to the left."""
    brake_current: float = bounded(0.0, 200.0, "A", 0.0)
    """Brake with this current at zero speed [A]; 0: zero ERPM, under which VESCs let the motor
    roll."""
    command_timeout: float = bounded(0.05, 0.9, "s", 0.5)
    """The driver sends zero when the last command is older [s]; below the board's own second."""


class VescDriver(PolledDriver):
    """VESCs: ERPM by 8, the second through 34, values by 50 or, for old firmware, 4.

    A car's servo is on the first's servo output: positions by 12, which is not answered, and does
    not feed the time-out.

    Their time-out (1 s unless changed in VESC Tool) is fed by commands only; ALIVE (30), which
    would keep an old set-point, is never sent.
    """

    board = "VESC"
    options_type = VescOptions
    answers_commands = False

    def __init__(self, transport: Transport, geometry: Geometry, options: VescOptions) -> None:
        odometry = WheelOdometry(geometry, STEPS_PER_ELECTRIC_TURN * options.pole_pairs, wraps=True)
        super().__init__(transport, geometry, odometry, options)
        self._erpm = 60.0 * options.pole_pairs
        if (
            geometry.max_wheel_speed
            / geometry.wheel_radius
            * geometry.gear_ratio
            / math.tau
            * self._erpm
            >= 2**31
        ):
            raise ConfigError(
                f"board.pole_pairs: {options.pole_pairs} makes speeds past the board's 32 bits"
            )
        if (self._steering is None) == (options.can_id is None):
            raise ConfigError(
                "board.can_id: missing: expected that of the second VESC"
                if options.can_id is None
                else "board.can_id: a car has one motor: leave it out"
            )
        self._can_id, self._options = options.can_id, options
        self._nodes = ("local",) if options.can_id is None else ("local", "can")
        self._brake = round(1000.0 * options.brake_current)
        self._packets = VescPackets(MAX_PAYLOAD)
        self._local_id: int | None = None
        self._selective = True
        self.hint = "is it powered, wired TX to RX, with its app set to UART and this baud rate?"

    def _configure(self) -> None:
        self._local_id = None
        version, _ = self._ask(vesc_packet(bytes((FW_VERSION,))), "version")
        if len(version) < 3:
            raise self._exchange.refuse("firmware version")
        self._mode = f"firmware {version[1]}.{version[2]:02d}"
        self._drive(*self._geometry.still)
        self._selective = True
        try:
            values = self._values("local")
        except NoReply:
            self._settle()
            self._selective = False
            values = self._values("local")
        self._local_id = values[3]
        if self._can_id is not None:
            self.hint = f"is the second VESC (CAN id {self._can_id}) powered and on the CAN bus?"
            self._values("can")

    def _poll(self, cycle: int) -> None:
        told = [self._values(node) for node in self._nodes]
        self._errors = tuple(
            f"{which} VESC: {FAULTS[fault] if fault < len(FAULTS) else f'fault {fault}'}"
            for (_, _, fault, _, _), which in zip(told, ("first", "second"), strict=False)
            if fault
        )
        self._estimate_ok = not ENCODER_FAULTS & {fault for _, _, fault, _, _ in told}
        # All tachometers at the same instant, so that their difference is a turn and nothing else.
        last = told[-1][4]
        counts = (
            tacho + rpm / 60.0 * STEPS_PER_ELECTRIC_TURN * (last - stamp)
            for rpm, tacho, _, _, stamp in told
        )
        self._moved(tuple(counts), tuple(rpm / self._erpm for rpm, *_ in told), last)

    def _barrier(self) -> None:
        self._ask(vesc_packet(bytes((FW_VERSION,))), "version")

    def _values(self, which: str) -> tuple[int, int, int, int, float]:
        """Ask one VESC: ERPM, tachometer, fault, controller id, stamp."""
        request = (
            struct.pack(">BI", GET_SELECTIVE, MASK) if self._selective else bytes((GET_VALUES,))
        )
        if which == "can":
            request = self._forwarded(request)
        reply, stamp = self._ask(vesc_packet(request), (which, self._selective))
        return (*_numbers(reply), stamp)

    def _drive(self, *speeds: float) -> None:
        payloads = [self._set_point(speed) for speed in speeds]
        payloads[1:] = map(self._forwarded, payloads[1:])
        if self._steering is not None:
            position = servo_position(self._options, self._steering.share)
            payloads.append(struct.pack(">Bh", SET_SERVO_POS, round(1000.0 * position)))
        self._transport.write(b"".join(map(vesc_packet, payloads)))

    def _forwarded(self, payload: bytes) -> bytes:
        """Send it to the second VESC, through CAN."""
        assert self._can_id is not None
        return bytes((FORWARD_CAN, self._can_id)) + payload

    def _set_point(self, speed: float) -> bytes:
        if speed == 0.0 and self._brake:
            return struct.pack(">Bi", SET_BRAKE, self._brake)
        return struct.pack(">Bi", SET_RPM, round(speed * self._erpm))

    def _release(self) -> None:
        free = struct.pack(">Bi", SET_CURRENT, 0)
        payloads = [free] if self._can_id is None else [free, self._forwarded(free)]
        self._transport.write(b"".join(map(vesc_packet, payloads)))

    def _begin(self, key: Hashable) -> None:
        self._packets.reset()

    def _feed(self, data: bytes, stamp: float) -> None:
        with self._changed:
            payloads = self._packets.feed(data, stamp)
        for payload in payloads:
            self._exchange.deliver(self._key(payload), payload, stamp)

    def _key(self, payload: bytes) -> Hashable:
        """Which request this answers, None for none."""
        if payload[0] == FW_VERSION:
            return "version"
        selective = payload[0] == GET_SELECTIVE
        if selective and (
            len(payload) != SELECTIVE.size or int.from_bytes(payload[1:5], "big") != MASK
        ):
            return None
        if not selective and (payload[0] != GET_VALUES or len(payload) < VALUES.size):
            return None
        sender = _numbers(payload)[3]
        if sender == self._can_id:
            return ("can", selective)
        return ("local", selective) if self._local_id in (None, sender) else None

    def _damaged(self) -> int:
        return self._packets.bad


def _numbers(payload: bytes) -> tuple[int, int, int, int]:
    """ERPM, tachometer, fault, controller id of either kind of answer."""
    if payload[0] == GET_SELECTIVE:
        return SELECTIVE.unpack(payload)[2:]
    values = VALUES.unpack(payload[: VALUES.size])
    return values[VALUES_RPM], values[VALUES_TACHO], values[VALUES_FAULT], values[VALUES_ID]
