"""Print how large the project is beside what it may be: lines, files, options, states, functions.

`make budgets` runs it. A budget that does not hold is marked; nothing fails.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

import kmpc_lite as kl
from kmpc_lab.sim.lidar import scan_of, scan_ranges
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.scenario.lidar import LidarSpec
from kmpc_lite.scenario.world import World

ROOT = Path(__file__).parents[1]
PACKAGE = str(Path(kl.__file__).parent)
STEPS = 300
LINES = {
    "kmpc_lite": 17_000,
    "kmpc_lite/control": 9_000,
    "firmware_bridge": 19_000,
    "lab": 15_000,
    "tests": 36_000,
}
CONTROL_FILES = 75
OPTIONS = 90
FUNCTIONS = 250
WORDS = 30_000


def tracked(pattern: str) -> list[Path]:
    """Files that the repository holds, as they are in the work tree."""
    names = subprocess.run(
        ["git", "ls-files", pattern], cwd=ROOT, capture_output=True, text=True, check=True
    ).stdout.split()
    return [path for name in names if (path := ROOT / name).is_file()]


def lines(folder: str) -> int:
    """Lines of Python, docstrings included."""
    return sum(len(path.read_text().splitlines()) for path in tracked(f"{folder}/*.py"))


def leaves(options: type) -> Iterator[str]:
    """Names of all options, those of its groups included."""
    made = options()
    for field in fields(options):
        value = getattr(made, field.name)
        if is_dataclass(value):
            yield from leaves(type(value))
        else:
            yield field.name


def state_attributes(value: Any, seen: set[int]) -> int:
    """How many attributes the objects of the project have that can be reached from a state."""
    if id(value) in seen:
        return 0
    seen.add(id(value))
    if isinstance(value, (list, tuple)):
        return sum(state_attributes(v, seen) for v in value)
    if not type(value).__module__.startswith("kmpc_lite.control"):
        return 0
    slots = [s for c in type(value).__mro__ for s in getattr(c, "__slots__", ())]
    names = [*getattr(value, "__dict__", {}), *slots]
    inside = [getattr(value, name) for name in names if hasattr(value, name)]
    return len(names) + sum(state_attributes(v, seen) for v in inside)


def functions_reached(drive: Callable[[], None]) -> int:
    """How many functions of kmpc_lite a drive calls."""
    codes: set[CodeType] = set()

    def note(frame: FrameType, event: str, argument: Any) -> None:
        if event == "call":
            codes.add(frame.f_code)

    sys.setprofile(note)
    try:
        drive()
    finally:
        sys.setprofile(None)
    return sum(code.co_filename.startswith(PACKAGE) for code in codes)


class Drive:
    """Past circles, a wall and a circle that moves, half of the way by lidar alone."""

    def __init__(self) -> None:
        self.controller = kl.Controller(kl.nominal_unicycle(0.1))
        self.pose, self.goal = np.zeros(3), (1.5, 1.5, 0.0)
        self.random = np.random.default_rng(1)

    def __call__(self) -> None:
        """Drive for `STEPS` periods."""
        circles = np.array([(0.6, 0.6, 0.15), (1.2, 0.5, 0.15), (0.4, 1.3, 0.15)])
        wall = kl.Wall(-1.0, -0.5, 1.0, -0.5)
        rows = np.pad(circles, ((0, 0), (0, 2)))
        world = World(rows, [(-1.0, -0.5, 1.0, -0.5), (1.9, -1.0, 1.9, 1.9)])
        lidar = LidarSpec(4.0)
        for k in range(STEPS):
            if k % 75 == 74:
                self.goal = tuple(np.multiply(-1.0, self.goal))
            if k < STEPS // 2:
                moving = kl.Circle(1.0 - 0.02 * k, 0.2, 0.1, vx=-0.2)
                obstacles = [*(kl.Circle(*row) for row in circles), wall, moving]
            else:
                ranges, _ = scan_ranges(world, lidar, self.pose, self.random)
                obstacles = [scan_of(lidar, ranges)]
            plan = self.controller.step(self.pose, self.goal, obstacles)
            v, omega = plan.command
            x, y, theta = self.pose
            self.pose = np.array(
                [x + 0.1 * v * np.cos(theta), y + 0.1 * v * np.sin(theta), theta + 0.1 * omega]
            )


def main() -> None:
    """Print the table."""
    rows = [(f"lines of {name}", lines(name), most) for name, most in LINES.items()]
    rows.append(
        ("files of kmpc_lite/control", len(tracked("kmpc_lite/control/*.py")), CONTROL_FILES)
    )
    options = list(leaves(ControllerOptions))
    rows.append(("options", len(options), OPTIONS))
    drive = Drive()
    rows.append((f"functions reached in {STEPS} steps", functions_reached(drive), FUNCTIONS))
    rows.append(("attributes of the state", state_attributes(drive.controller.state, set()), 0))
    words = sum(len(path.read_text().split()) for path in tracked("docs/*.md"))
    rows.append(("words of docs", words, WORDS))
    for name, found, most in rows:
        budget = f"of {most:,}" + ("" if found <= most else "  (exceeded)") if most else ""
        sys.stdout.write(f"{name:36}{found:>9,}  {budget}\n")


if __name__ == "__main__":
    main()
