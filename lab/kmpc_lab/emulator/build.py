"""The emulator of a robot file: its board, and a robot under it."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any, Protocol

from firmware_bridge.drivers.boards import load
from firmware_bridge.robot_file import Robot

if TYPE_CHECKING:
    from kmpc_lab.emulator.board import BoardEmulator
    from kmpc_lab.emulator.rover.physics import RoverPhysics
    from kmpc_lab.sim.twin import Twin

EMULATORS = {
    "mavlink": "kmpc_lab.emulator.rover.rover:RoverEmulator",
    "roboclaw": "kmpc_lab.emulator.roboclaw:RoboClawEmulator",
    "odrive": "kmpc_lab.emulator.odrive:ODriveEmulator",
    "vesc": "kmpc_lab.emulator.vesc:VescEmulator",
    "roboteq": "kmpc_lab.emulator.roboteq:RoboteqEmulator",
    "sabertooth": "kmpc_lab.emulator.sabertooth:SabertoothEmulator",
    "arduino": "kmpc_lab.emulator.arduino:ArduinoEmulator",
    "onboard": "kmpc_lab.emulator.onboard:OnboardEmulator",
}
"""MODULE:CLASS of the far end of a board's link, by its driver."""
GPS_NOISE = 0.01  # slow error of an emulated autopilot's position [m], as the real firmware has it


class Emulator(Protocol):
    """The other end of a link."""

    def start(self, url: str) -> None:
        """Serve."""

    @property
    def pose(self) -> tuple[float, float, float]:
        """True x, y [m], theta [rad]."""

    @property
    def stopped(self) -> bool:
        """Whether it stands, or is commanded to."""

    def close(self) -> None:
        """Stop serving."""


def build_emulator(
    robot: Robot,
    start: tuple[float, float, float],
    slip: float,
    turn_gain: float,
    seed: int,
    arm_after: float,
    twin: Twin | None = None,
) -> Emulator:
    """Build the board of a robot file, and a robot under it: one that slips, or a digital twin."""
    floor: dict[str, Any] = {"slip": slip, "turn_gain": turn_gain, "seed": seed}
    kind = load(EMULATORS[robot.link.driver])
    if robot.is_autopilot:
        from kmpc_lab.emulator.rover.estimator import MOTION_CAPTURE

        physics: RoverPhysics | None = None
        system = robot.sections.get("board", {}).get("system", 1)
        parameters = dict(MOTION_CAPTURE) if robot.link.pose is not None else {}
        if twin is not None:
            from kmpc_lab.emulator.twin import TwinRover

            physics = TwinRover(twin)
        elif robot.wheels.kind == "car":
            from kmpc_lab.emulator.rover.physics import SteeredRover, tuned

            physics = SteeredRover(robot.wheels.radius, **floor)
            parameters |= tuned(robot.wheels.radius)
        rover: Emulator = kind(
            **floor,
            pose=start,
            arm_after=arm_after,
            system=system,
            physics=physics,
            parameters=parameters,
            noise=GPS_NOISE,
        )
        return rover
    emulator: BoardEmulator = kind.from_options(robot.driver_table(), **floor)
    if twin is not None:
        from kmpc_lab.emulator.twin import TwinBody

        emulator.put_on(TwinBody(emulator.geometry, twin, time.monotonic()))
    emulator.place(*start)
    return emulator
