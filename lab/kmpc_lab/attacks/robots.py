"""The robots that are attacked: an emulated rover, and the emulated motor controllers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from firmware_bridge.drivers.boards import BOARDS

SPEED = 0.3
"""At which they drive straight ahead [m/s]."""


def sections(
    driver: str,
    url: str,
    pose: str | None = None,
    socket: str | None = None,
    lidar: tuple[str, str] | None = None,
    forward: str | None = None,
) -> dict[str, Mapping[str, Any]]:
    """Sections of a robot file of `driver` at `url`, perhaps with a lidar: its kind and link."""
    entry = BOARDS[driver]
    board = entry.options
    if driver == "mavlink" and pose is not None:
        board = {**board, "origin": [47.0, 8.0, 400.0]}
    return {
        "link": {"url": url, "driver": driver, "pose": pose, "timeout": 20.0, "forward": forward},
        "board": board,
        "geometry": entry.geometry,
        "limits": {"v_max": SPEED, "v_reverse": SPEED},
        "safety": {"socket": socket, "settle": 0.2},
        "lidar": {} if lidar is None else {"driver": lidar[0], "link": lidar[1]},
    }
