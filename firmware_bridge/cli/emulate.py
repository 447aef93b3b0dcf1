"""Serve an emulated robot on a link until somebody ends it."""

from __future__ import annotations

import signal
import threading
import time
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol, TextIO

from firmware_bridge.emulator.mocap import MocapSender
from firmware_bridge.link.url import LinkUrl
from firmware_bridge.messages import ConfigError
from firmware_bridge.robot_file import Robot

if TYPE_CHECKING:
    from firmware_bridge.emulator.board import BoardEmulator
    from kmpc_lite.sim.twin import Twin

BOARDS = {
    "roboclaw": "RoboClawEmulator",
    "odrive": "ODriveEmulator",
    "vesc": "VescEmulator",
    "roboteq": "RoboteqEmulator",
    "sabertooth": "SabertoothEmulator",
    "arduino": "ArduinoEmulator",
}
"""By the name of their modules: only the one that is needed is imported."""
SHOWN = 0.5
"""Between pictures of the pose [s]."""


class Emulator(Protocol):
    """The other end of a link."""

    def start(self, url: str) -> None:
        """Serve."""
        ...

    @property
    def pose(self) -> tuple[float, float, float]:
        """True x, y [m], theta [rad]."""
        ...

    @property
    def stopped(self) -> bool:
        """Whether it stands, or is told to."""
        ...

    def close(self) -> None:
        """Stop serving."""
        ...


def build_emulator(
    robot: Robot,
    start: tuple[float, float, float],
    slip: float,
    turn_gain: float,
    seed: int,
    arm_after: float,
    twin: Twin | None = None,
) -> Emulator:
    """Build the board of a robot file with a robot under it that stands at `start`: one that slips, or a digital twin."""
    floor: dict[str, Any] = {"slip": slip, "turn_gain": turn_gain, "seed": seed}
    if robot.is_autopilot:
        from firmware_bridge.emulator.rover.parameters import MOTION_CAPTURE
        from firmware_bridge.emulator.rover.rover import RoverEmulator

        physics = None
        if twin is not None:
            from firmware_bridge.emulator.twin import TwinRover

            physics = TwinRover(twin)
        system = robot.sections.get("board", {}).get("system", 1)
        parameters = MOTION_CAPTURE if robot.link.pose is not None else None
        return RoverEmulator(
            **floor,
            pose=start,
            arm_after=arm_after,
            system=system,
            physics=physics,
            parameters=parameters,
        )
    module = import_module(f"firmware_bridge.emulator.{robot.link.driver}")
    emulator: BoardEmulator = getattr(module, BOARDS[robot.link.driver]).from_options(
        robot.driver_table(), **floor
    )
    if twin is not None:
        from firmware_bridge.emulator.twin import TwinBody

        emulator.put_on(TwinBody(emulator.geometry, twin, time.monotonic()))
    emulator.place(*start)
    return emulator


def emulate(
    emulator: Emulator,
    url: str,
    seconds: float | None,
    out: TextIO | None,
    pose: str | None = None,
    seed: int = 0,
) -> dict[str, Any]:
    """Serve until SIGINT, SIGTERM, or for so long [s]; tells the last pose. With `pose`, motion capture sends there, noise of `seed`.

    Raises
    ------
    ConfigError, LinkError
        Where the link cannot be served.
    """
    if LinkUrl.parse(url).kind == "serial":
        raise ConfigError(f"link {url}: an emulator serves pty:, tcp: or udp:; give --link")
    done = threading.Event()
    handlers = {
        number: signal.signal(number, lambda *_: done.set())
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    until = None if seconds is None else time.monotonic() + seconds
    camera = None if pose is None else MocapSender(lambda: emulator.pose, pose, seed)
    try:
        emulator.start(url)
        if camera is not None:
            camera.start()
        if out is not None:
            out.write(f"serving {url}; Ctrl-C ends\n")
            out.flush()
        while not done.is_set() and (until is None or time.monotonic() < until):
            done.wait(SHOWN if until is None else min(SHOWN, max(0.0, until - time.monotonic())))
            if out is not None and out.isatty():
                x, y, theta = emulator.pose
                out.write(
                    f"\r\x1b[2Kx {x:8.3f} m   y {y:8.3f} m   theta {theta:7.3f} rad   {'stands' if emulator.stopped else 'moves'}"
                )
                out.flush()
        return {
            "link": url,
            "pose": [round(c, 6) for c in emulator.pose],
            "stopped": emulator.stopped,
        }
    finally:
        if camera is not None:
            camera.close()
        emulator.close()
        for number, handler in handlers.items():
            signal.signal(number, handler)
