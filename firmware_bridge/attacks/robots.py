"""The robots that are attacked: an emulated rover, and the emulated motor controllers."""

from __future__ import annotations

from typing import Any

from firmware_bridge.cli.emulated_board import BOARDS, GEOMETRY

SPEED = 0.3
"""At which they drive straight ahead [m/s]."""


def sections(
    driver: str,
    url: str,
    pose: str | None = None,
    socket: str | None = None,
    lidar: tuple[str, str] | None = None,
    forward: str | None = None,
) -> dict[str, dict[str, Any]]:
    """Sections of a robot file of `driver` at `url`, perhaps with a lidar: its kind and link."""
    board = {**BOARDS, "sabertooth": {"full_speed": 0.9}}[driver]
    if driver == "mavlink" and pose is not None:
        board = {**board, "origin": [47.0, 8.0, 400.0]}
    return {
        "link": {"url": url, "driver": driver, "pose": pose, "timeout": 20.0, "forward": forward},
        "board": board,
        "geometry": {} if driver == "mavlink" else GEOMETRY,
        "limits": {"v_max": SPEED, "v_reverse": SPEED},
        "safety": {"socket": socket, "settle": 0.2},
        "lidar": {} if lidar is None else {"driver": lidar[0], "link": lidar[1]},
    }
