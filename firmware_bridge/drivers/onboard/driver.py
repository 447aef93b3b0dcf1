"""A microcontroller with an exported controller: drives to a goal by itself, or as it is told."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from firmware_bridge.drivers.onboard.board_clock import BoardClock
from firmware_bridge.drivers.onboard.messages import (
    ESTOPPED,
    STANDING,
    About,
    Kind,
    Telemetry,
    decoder,
    heartbeat,
    message,
    model,
    parse,
    pose,
    velocity,
)
from firmware_bridge.drivers.onboard.task import Task, task_of
from firmware_bridge.drivers.ticking import TickingDriver
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link import Transport
from firmware_bridge.messages import LinkError, LinkStatus, State
from firmware_bridge.options import bounded, check

TICK = 0.1
"""Between heartbeats [s]: the board stops without any for 0.5 s."""
REPEAT = 3
"""Heartbeats between repetitions of obstacles and path, which hold for 1 and 2 s."""
SILENT = 0.5
"""Telemetry that is older shows a board that is gone [s]."""


@dataclass(frozen=True)
class OnboardOptions:
    """The ``[board]`` section of a robot file."""

    command_timeout: float = bounded(0.05, 10.0, "s", 0.2)
    """The driver sends zero when the last speeds are older [s]; the board stops after 0.25 s."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)


class OnboardDriver(TickingDriver):
    """The near end of a link to `host.c` of an export.

    `send` has the board drive at a speed, as any motor controller; `drive_to` has it drive by
    itself, as long as it is fed with poses. Heartbeats go out all the time.

    Parameters
    ----------
    transport : Transport
        Not yet started; the driver starts and closes it.
    geometry : Geometry
        Of the robot.
    options : OnboardOptions
        How long speeds hold.
    """

    board, options_type, tick = "Onboard", OnboardOptions, TICK

    def __init__(self, transport: Transport, geometry: Geometry, options: OnboardOptions) -> None:
        super().__init__(transport, geometry)
        self._options = options
        self._frames = decoder()
        self._command, self._stamp = (0.0, 0.0), -math.inf
        self._task: Task | None = None
        self._pose: tuple[float, float, float] | None = None
        self._pose_stamp = -math.inf
        self._beats = 0
        self._clock = BoardClock()
        self._counters = dict.fromkeys(("stale_commands", "refused_commands", "refused"), 0)
        self.about: About | None = None
        """The board's controller, once it has said what it is."""
        self.telemetry: Telemetry | None = None
        """The newest one."""

    def connect(self, timeout: float) -> None:
        """Open the link, and ask the board what it is; LinkError if it does not answer."""
        self._start(self._on_bytes)
        with self._lock:
            known = self._lock.wait_for(
                lambda: self.about is not None and self._clock.known, timeout
            )
        if not known:
            why = self._transport.last_error or (
                f"{self._frames.bad} frames came and none made sense: another baud rate or version?"
                if self._frames.bad
                else "is it powered, wired TX to RX, and running an exported controller?"
            )
            raise LinkError(f"onboard: no answer within {timeout:g} s: {why}")

    def state(self) -> State | None:
        """Speeds that it drives at; the pose that it was fed with, or the origin without any."""
        told = self.telemetry
        v, omega = (0.0, 0.0) if told is None else told.command
        with self._lock:
            if self._pose is None:
                return State(0.0, 0.0, 0.0, v, omega, time.monotonic())
            return State(*self._pose, v, omega, self._pose_stamp)

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        """Have it drive at a speed; a task is given up."""
        v, omega, _ = self._geometry.body(self._geometry.wheels(v, omega, vy))
        with self._lock:
            self._task = None
            if (v, omega) == (0.0, 0.0):
                self._released = False  # only standing still may take the motors back
            elif self._released:
                self._counters["refused_commands"] += 1
                return
            self._set(v, omega)

    def drive_to(
        self,
        goal: Sequence[float],
        obstacles: Sequence[Sequence[float]] = (),
        path: Sequence[Sequence[float]] = (),
    ) -> None:
        """Have it drive to a goal by itself; again with what has changed.

        Parameters
        ----------
        goal : sequence
            x, y, heading [m, m, rad].
        obstacles : sequence
            Rows x, y, radius [m], vx, vy [m/s].
        path : sequence
            Rows x, y, heading [m, m, rad], ending at the goal; none: straight there.

        Raises
        ------
        ValueError
            For numbers that are not finite, and for more than the board can hold.
        """
        about = self.about
        most = (24, 64) if about is None else (about.circles, about.poses)
        task = task_of(goal, obstacles, path, *most)
        with self._lock:
            self._task, self._command, self._released = task, (0.0, 0.0), False
            self._transport.write(task.messages())

    def feed_pose(self, x: float, y: float, theta: float, stamp: float) -> None:
        """Pass on a pose from outside: [m, m, rad] at `time.monotonic()` [s]."""
        if not all(map(math.isfinite, (x, y, theta))):
            raise ValueError(f"pose: expected finite numbers, got {(x, y, theta)}")
        with self._lock:
            self._pose, self._pose_stamp = (x, y, theta), stamp
            if self._clock.known:
                self._transport.write(pose(x, y, theta, self._clock.at(stamp)))

    def send_model(self, numbers: Mapping[str, Any]) -> None:
        """Have it predict by another model: `kmpc_lite.embedded.model_numbers` works it out."""
        self._transport.write(model(numbers))

    def estop(self) -> None:
        """Stand at once, until `release`."""
        with self._lock:
            self._task = None
            self._transport.write(message(Kind.ESTOP))

    def release(self) -> None:
        """End an emergency stop: the board has then heard nothing, and stands."""
        self._transport.write(message(Kind.RELEASE))

    def health(self) -> LinkStatus:
        """What is known of the board."""
        now, told = time.monotonic(), self.telemetry
        fresh = told is not None and now - told.stamp < SILENT
        stopped = told is not None and told.standing == STANDING[ESTOPPED]
        faults = (STANDING[ESTOPPED],) if stopped else ()
        if not fresh and self._started:
            faults = (*faults, self._transport.last_error or "the board is silent")
        counters = {} if told is None else {"board_frames": told.good, "board_refused": told.bad}
        return LinkStatus(
            connected=self._transport.connected,
            heartbeat_stamp=-math.inf if told is None else told.stamp,
            pose_stamp=self._pose_stamp,
            ready=fresh and not stopped and not self._released,
            armed=not self._released,
            mode="" if told is None else told.standing or "drives",
            faults=faults,
            counters={**self._transport.counters, **self._counters, **counters}
            | {"bad_frames": self._frames.bad},
        )

    def _halt(self) -> None:
        self._task = None
        self._set(0.0, 0.0)

    def _set(self, v: float, omega: float) -> None:
        self._command, self._stamp = (v, omega), time.monotonic()
        if self._clock.known:
            self._transport.write(velocity(v, omega, self._clock.at(self._stamp)))

    def _on_bytes(self, data: bytes, stamp: float) -> None:
        for body in self._frames.feed(data):
            said = parse(body, stamp)
            with self._lock:
                if isinstance(said, About):
                    self.about = said
                elif said is not None:
                    self.telemetry = said
                    self._clock.hear(said.uptime, said.stamp)
                else:
                    self._counters["refused"] += 1
                self._lock.notify_all()

    def _remind(self, now: float) -> None:
        """Say that we are there, and what must be repeated."""
        self._transport.write(heartbeat(self._beats))
        if self.about is None:
            self._transport.write(message(Kind.ASK))
        if self._task is not None:
            if self._beats % REPEAT == 0:
                self._transport.write(self._task.messages())
        elif self._command != (0.0, 0.0):
            if now - self._stamp > self._options.command_timeout:
                self._counters["stale_commands"] += 1
                self._set(0.0, 0.0)
        else:
            self._set(0.0, 0.0)  # a zero may be lost; anything else is for the gate to repeat
        self._beats += 1
