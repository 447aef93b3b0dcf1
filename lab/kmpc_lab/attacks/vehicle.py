"""The robots that are attacked, each an emulated board in a process of its own.

It writes down where it really is.

``python -m kmpc_lab.attacks.vehicle DRIVER URL POSES TRACE LIDAR LINK``; POSES is where
motion capture sends, or "", and LIDAR the kind of its lidar, or "". It ends with its standard
input.
"""

from __future__ import annotations

import select
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from firmware_bridge.drivers.boards import BOARDS
from firmware_bridge.robot_file import load_robot
from kmpc_lab.emulator.build import build_emulator
from kmpc_lab.emulator.lidar.kinds import emulated_lidar
from kmpc_lab.emulator.mocap import MocapSender
from kmpc_lite.scenario.world import World

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


PILLARS = [(x, y, 2.0, 0.0, 0.0) for x, y in ((-3.0, 0.0), (6.0, 0.0), (0.0, 4.0), (0.0, -4.0))]
"""What its lidar sees: rows x, y, radius [m], beside its path."""
SAMPLE = 0.005
"""Between lines of the trace [s]."""


def main(driver: str, url: str, poses: str, trace: str, lidar: str, link: str) -> None:
    """Serve, and write `time x y` [s, m, m] until standard input ends."""
    sees = (lidar, link) if lidar else None
    robot = load_robot(None, sections(driver, url, poses or None, lidar=sees))
    emulator = build_emulator(robot, (0.0, 0.0, 0.0), 0.0, 1.0, 0, 0.1)
    camera = MocapSender(lambda: emulator.pose, poses, 0) if poses else None
    eyes = None
    if robot.lidar is not None:
        world = World(PILLARS)
        eyes = emulated_lidar(robot.lidar, world, lambda: emulator.pose)
        eyes.start(link)
    lines: list[str] = []
    emulator.start(url)
    if camera is not None:
        camera.start()
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    while not select.select([sys.stdin], [], [], SAMPLE)[0]:
        x, y, _ = emulator.pose
        lines.append(f"{time.monotonic():.4f} {x:.5f} {y:.5f}\n")
    Path(trace).write_text("".join(lines))
    if camera is not None:
        camera.close()
    if eyes is not None:
        eyes.close()
    emulator.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
