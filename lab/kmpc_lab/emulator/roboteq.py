"""A Roboteq in closed-loop speed mode: its ASCII commands, its watchdog, its faults."""

from __future__ import annotations

import re
from typing import Unpack

from firmware_bridge.drivers.roboteq import RPM, RoboteqOptions
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link.framing import Lines
from firmware_bridge.odometry import wrapped
from kmpc_lab.emulator.board import BoardEmulator, Scene

WORD = re.compile(r"-?\d{1,10}")
DELIVERED_WATCHDOG = 1000  # `RWD` as delivered [ms]
STOPPING = 0xFF  # any bit of `?FF` stops the motors


class RoboteqEmulator(BoardEmulator):
    """A Roboteq with a robot under it.

    The watchdog is fed by commands (`!`) only. When it trips the motors stop, but their set-points
    stay: the next
    command, whichever motor it is for, lets both go on, as the real one does.

    Geometry and options are the robot's, as for the driver.
    """

    boot_text = b"\r\nRoboteq v1.8 FBL2360 11/27/2017\r"
    options_type = RoboteqOptions

    def __init__(
        self, geometry: Geometry, options: RoboteqOptions, **around: Unpack[Scene]
    ) -> None:
        super().__init__(geometry, **around)
        self._counts_per_turn = options.counts_per_turn
        self._lines = Lines()
        self.modes = [1, 1]  # MMOD of both channels
        self._reset()

    def _reset(self) -> None:
        self.faults = 0  # bits of `?FF`; set them to see what the other end does
        self.motor_flags = [0, 0]  # bits of `?FM`
        self.watchdog = DELIVERED_WATCHDOG  # RWD [ms], 0 for none
        self.echo = True
        self._wanted = [0.0, 0.0]
        self._fed = self._clock()

    def _watchdog(self, now: float) -> None:
        tripped = bool(self.watchdog) and now - self._fed > self.watchdog / 1000.0
        stopped = tripped or bool(self.faults & STOPPING)
        for channel in (0, 1):
            self._set(channel, 0.0 if stopped else self._wanted[channel])

    def _answer(self, data: bytes, now: float) -> bytes:
        out = b""
        for line in self._lines.feed(data):
            if self.echo:
                out += line + b"\r"
            out += self._execute(line.decode("ascii", "replace").strip(), now)
        self._watchdog(now)
        return out

    def _execute(self, text: str, now: float) -> bytes:
        kind, words = text[:1], text[1:].split()
        if not words or kind not in ("!", "?", "^", "~"):
            return b"-\r"
        name, arguments = words[0].upper(), words[1:]
        if not all(WORD.fullmatch(word) for word in arguments):
            return b"-\r"
        numbers = [int(word) for word in arguments]
        if kind in ("?", "~"):
            values = self._read(kind + name)
            return b"-\r" if values is None else f"{name}={':'.join(map(str, values))}\r".encode()
        done = self._command(name, numbers, now) if kind == "!" else self._set_up(name, numbers)
        return b"+\r" if done else b"-\r"

    def _command(self, name: str, numbers: list[int], now: float) -> bool:
        if name in ("S", "G", "MS") and not (numbers and numbers[0] in (1, 2)):
            return False
        if name == "S" and len(numbers) == 2 and abs(numbers[1]) <= 65000:
            self._wanted[numbers[0] - 1] = numbers[1] / RPM
        elif name == "MS":
            self._wanted[numbers[0] - 1] = 0.0
        elif name == "EX":
            self.faults |= 0x10
        elif name == "MG":
            self.faults &= ~0x10
        else:
            return False
        self._fed = now
        return True

    def _set_up(self, name: str, numbers: list[int]) -> bool:
        if name == "ECHOF" and numbers in ([0], [1]):
            self.echo = numbers == [0]
        elif name == "RWD" and len(numbers) == 1 and 0 <= numbers[0] <= 65000:
            self.watchdog = numbers[0]
        elif name == "MMOD" and len(numbers) == 2 and numbers[0] in (1, 2):
            self.modes[numbers[0] - 1] = numbers[1]
        else:
            return False
        return True

    def _read(self, question: str) -> list[int] | None:
        counts = [round(self._turns(i) * self._counts_per_turn) for i in (0, 1)]
        answers = {
            "?C": [int(wrapped(count)) for count in counts],
            "?S": [round(self._body.speeds[i] * RPM) for i in (0, 1)],
            "?FF": [self.faults],
            "?FM": self.motor_flags,
            "~RWD": [self.watchdog],
            "~MMOD": self.modes,
        }
        return answers.get(question)
