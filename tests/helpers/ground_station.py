"""A station that talks to an emulated rover, message by message, on a clock of the tests' own."""

from __future__ import annotations

import math
from collections.abc import Callable

from mavlink_rig import dialect

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
from kmpc_lab.emulator.rover.autopilot import GUIDED
from kmpc_lab.emulator.rover.rover import RoverEmulator

ACCEPTED, DENIED, UNSUPPORTED, FAILED = 0, 2, 3, 4
Message = dialect.MAVLink_message


class Ground:
    """A rover and a station that talks to it."""

    def __init__(self, system: int = 255, component: int = 190, **rover: object) -> None:
        self.now = 50.0
        self.heard: list[Message] = []
        self._in, self._out = MavlinkCodec(9, 9), MavlinkCodec(system, component)
        self.rover = RoverEmulator(clock=lambda: self.now, **rover)  # type: ignore[arg-type]
        self.rover.connect(lambda frame: self.heard.extend(self._in.feed(frame, self.now)))

    def say(self, message: Message) -> None:
        self.rover.receive(self._out.encode(message), self.now)

    def run(self, seconds: float, each: Callable[[], None] | None = None) -> None:
        for _ in range(round(seconds / 0.02)):
            if each is not None:
                each()
            self.now += 0.02
            self.rover.step()

    def ask(self, message: Message, wait: float = 0.03) -> list[Message]:
        """What comes back."""
        self.heard.clear()
        self.say(message)
        self.run(wait)
        return list(self.heard)

    def command(self, command: int, *parameters: float) -> int:
        """Result of a COMMAND_LONG."""
        values = [*parameters, *[0.0] * (7 - len(parameters))]
        answers = self.ask(dialect.MAVLink_command_long_message(1, 1, command, 0, *values))
        acks = [m for m in answers if m.get_type() == "COMMAND_ACK"]
        assert [(m.command, m.target_system, m.target_component) for m in acks] == [
            (command, 255, 190)
        ]
        return int(acks[0].result)

    def texts(self) -> list[str]:
        return [m.text for m in self.heard if m.get_type() == "STATUSTEXT"]

    def of(self, kind: str) -> list[Message]:
        return [m for m in self.heard if m.get_type() == kind]

    def guided(self) -> None:
        self.run(3.0)
        assert self.rover.pilot_mode(GUIDED)
        assert self.rover.pilot_arm()

    def set_point(
        self,
        v: float,
        rate: float,
        mask: int = 0x5C7,
        frame: int = 8,
        vy: float = 0.0,
        yaw: float = 0.0,
    ) -> None:
        rest = (0.0,) * 3
        self.say(
            dialect.MAVLink_set_position_target_local_ned_message(
                0, 1, 1, frame, mask, *rest, v, vy, 0.0, *rest, yaw, rate
            )
        )

    def drive(self, v: float, rate: float, seconds: float, **more: float) -> tuple[float, float]:
        """Forward speed and turn rate (counter-clockwise) in the end."""
        self.run(seconds, lambda: self.set_point(v, rate, **more))  # type: ignore[arg-type]
        east, north, turn = self.rover.velocity
        theta = self.rover.pose[2]
        return east * math.cos(theta) + north * math.sin(theta), turn
