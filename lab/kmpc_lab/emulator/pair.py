"""Two emulated boards under one omni: `firmware_bridge.drivers.pair` is their near end."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from firmware_bridge.drivers.motor_board import geometry_of
from firmware_bridge.drivers.pair import halves
from firmware_bridge.kinematics import Geometry
from firmware_bridge.messages import command_of
from kmpc_lab.emulator.board import MOTOR_LAG, BoardEmulator
from kmpc_lab.emulator.body import Body
from kmpc_lab.sim.plants.steered import MecanumDrive


class Chassis:
    """Moves as its four wheels turn.

    Parameters
    ----------
    table : mapping
        Of the whole robot, as the driver takes it.
    slip, turn_gain, seed
        Of the floor: see `kmpc_lab.sim.plants`.
    """

    def __init__(self, table: Mapping[str, Any], slip: float, turn_gain: float, seed: int) -> None:
        self._geometry, self._turn_gain = geometry_of(table), turn_gain
        self._floor, self._lock = MecanumDrive(slip, seed), threading.Lock()
        self._turned = np.zeros(4)
        self.pose = np.zeros(3)
        """x, y [m], theta [rad]."""

    def roll(self, end: int, wheels: tuple[float, ...]) -> None:
        """Let the wheels of an end have turned so far [rad]."""
        with self._lock:
            steps = np.zeros(4)
            steps[2 * end : 2 * end + 2] = wheels - self._turned[2 * end : 2 * end + 2]
            self._turned += steps
            v, omega, vy = self._geometry.body(tuple(steps.tolist()))
            moved = command_of((v, self._turn_gain * omega, vy), 3)
            self.pose = self._floor.trace(self.pose, moved, 1.0, 1)[-1]


class EndBody(Body):
    """The wheels of one end, which move the chassis."""

    def __init__(self, geometry: Geometry, chassis: Chassis, end: int, now: float) -> None:
        super().__init__(geometry, slip=0.0, turn_gain=1.0, seed=0, lag=MOTOR_LAG, now=now)
        self._chassis, self._end = chassis, end

    def _step(self) -> None:
        super()._step()
        self._chassis.roll(self._end, self._geometry.from_channels(*self.turns))


class PairEmulator:
    """Two boards of a kind, each on its own link.

    Parameters
    ----------
    kind : type
        `BoardEmulator` of the boards.
    table : mapping
        Of the whole robot.
    second : str
        URL of the rear board's link.
    slip, turn_gain, seed
        Of the floor: see `kmpc_lab.sim.plants`.
    """

    def __init__(
        self,
        kind: type[BoardEmulator],
        table: Mapping[str, Any],
        second: str,
        slip: float = 0.0,
        turn_gain: float = 1.0,
        seed: int = 0,
    ) -> None:
        self._second, self._chassis = second, Chassis(table, slip, turn_gain, seed)
        self.boards = tuple(kind.from_options(half) for half in halves(table))
        """Front and rear."""
        for end, board in enumerate(self.boards):
            board.put_on(EndBody(board.geometry, self._chassis, end, time.monotonic()))

    def start(self, url: str) -> None:
        """Serve both links."""
        for board, link in zip(self.boards, (url, self._second), strict=True):
            board.start(link)

    @property
    def pose(self) -> tuple[float, float, float]:
        """True x, y [m], theta [rad]."""
        self.stopped  # noqa: B018 - brings both up to the clock
        x, y, theta = self._chassis.pose.tolist()
        return x, y, theta

    @property
    def stopped(self) -> bool:
        """Whether all set-points are zero."""
        return not [board for board in self.boards if not board.stopped]

    def place(self, x: float, y: float, theta: float) -> None:
        """Put the robot down somewhere: [m], [m], [rad]."""
        self._chassis.pose = np.array((x, y, theta))

    def close(self) -> None:
        """Pull both plugs."""
        for board in self.boards:
            board.close()
