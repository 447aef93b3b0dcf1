"""An emulated board in a process of its own, which writes down where it really is.

``python -m firmware_bridge.attacks.vehicle DRIVER URL POSES TRACE``; POSES is where motion capture
sends, or "". It ends with its standard input.
"""

from __future__ import annotations

import select
import sys
import time
from pathlib import Path

from firmware_bridge.attacks.robots import sections
from firmware_bridge.cli.emulate import build_emulator
from firmware_bridge.emulator.mocap import MocapSender
from firmware_bridge.robot_file import load_robot

SAMPLE = 0.005
"""Between lines of the trace [s]."""


def main(driver: str, url: str, poses: str, trace: str) -> None:
    """Serve, and write `time x y` [s, m, m] until standard input ends."""
    robot = load_robot(None, sections(driver, url, poses or None))
    emulator = build_emulator(robot, (0.0, 0.0, 0.0), 0.0, 1.0, 0, 0.1)
    camera = MocapSender(lambda: emulator.pose, poses, 0) if poses else None
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
    emulator.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
