"""The boards that can be driven: one record for each, which all tables of boards follow.

Other distributions add theirs by an entry point ``kmpc.boards``: ``name = "module:DriverClass"``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module, metadata
from typing import Any

from firmware_bridge.messages import ConfigError

ROSBOT = {"wheel_radius": 0.0425, "track": 0.27, "max_wheel_speed": 0.9}
"""Geometry of a ROSbot 2 [m, m, m/s]: on it emulated boards are measured and attacked."""


@dataclass(frozen=True)
class BoardEntry:
    """What the bridge must know of a board before it imports any of its code."""

    name: str  # of its driver in a robot file
    label: str  # as its maker writes it
    driver: str  # MODULE:CLASS of the near end of its link; imported only where it is needed
    latency: float = 0.0
    """From a command to the wheels, for a model without input history, by default
    [s]. With a motor controller's 0.05 s the clearance is the same for 0, 0.05 and 0.1 s."""
    wheels: tuple[str, ...] = ("differential",)  # kinds of wheels that it can drive
    encoders: bool = True
    """Whether it tells how the robot moves; if not, poses must come from outside."""
    options: Mapping[str, Any] = field(default_factory=dict)  # ``[board]`` of an emulated robot
    geometry: Mapping[str, float] = field(default_factory=lambda: ROSBOT)
    """``[geometry]`` of an emulated robot."""


OWN = {
    board.name: board
    for board in (
        BoardEntry(
            "mavlink",
            "MAVLink",
            "firmware_bridge.drivers.mavlink.driver:MavlinkDriver",
            # an autopilot's own speed loop lags: on the emulated rover the nominal unicycle grazes
            # obstacles with 0.1 s or less, not with 0.2 or 0.3 s
            latency=0.2,
            wheels=("differential", "car"),
            options={"arm": True},
            geometry={},
        ),
        BoardEntry(
            "roboclaw",
            "RoboClaw",
            "firmware_bridge.drivers.roboclaw:RoboClawDriver",
            options={"counts_per_turn": 1440.0},
        ),
        BoardEntry("odrive", "ODrive", "firmware_bridge.drivers.odrive:ODriveDriver"),
        BoardEntry(
            "vesc",
            "VESC",
            "firmware_bridge.drivers.vesc:VescDriver",
            wheels=("differential", "car"),
            options={"can_id": 1, "pole_pairs": 7},
        ),
        BoardEntry(
            "roboteq",
            "Roboteq",
            "firmware_bridge.drivers.roboteq:RoboteqDriver",
            options={"counts_per_turn": 1440.0},
        ),
        BoardEntry(
            "sabertooth",
            "Sabertooth",
            "firmware_bridge.drivers.sabertooth:SabertoothDriver",
            encoders=False,
            options={"full_speed": 0.9},
        ),
        BoardEntry(
            "arduino",
            "Arduino",
            "firmware_bridge.drivers.arduino:ArduinoDriver",
            wheels=("differential", "car", "omni"),
            options={"counts_per_turn": 1440.0},
        ),
        BoardEntry(
            "onboard", "Onboard", "firmware_bridge.drivers.onboard:OnboardDriver", encoders=False
        ),
    )
}
"""By name, in the order in which they are listed."""
BOARDS = OWN | {
    # which wheels such a board drives, it knows itself
    it.name: BoardEntry(it.name, it.name, it.value, wheels=("differential", "car", "omni"))
    for it in metadata.entry_points(group="kmpc.boards")
}
"""Those, and what other distributions add."""


def load(where: str) -> Any:
    """Import what a record names as MODULE:CLASS; ConfigError says what is wrong with it."""
    module, _, name = where.partition(":")
    try:
        return getattr(import_module(module), name)
    except (ImportError, AttributeError) as error:
        if where.startswith(__name__.partition(".")[0]):  # an extra is missing, which is told
            raise
        raise ConfigError(f"link.driver: cannot import {where}: {error}") from error
