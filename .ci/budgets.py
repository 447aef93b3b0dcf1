"""Hold the project to its size: lines, files, numbers, functions, states and words have limits.

`make budgets` runs it, and `make check` with it. It fails where a count is above its limit in
`.ci/budgets.toml`, where it is 2 % below and the limit was not lowered, and where a limit is higher
than in a commit before: limits only go down.
"""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

import kmpc_lite as kl
from kmpc_lab.sim.lidar import scan_of, scan_ranges
from kmpc_lite.scenario.values import LidarSpec
from kmpc_lite.scenario.world import World

ROOT = Path(__file__).parents[1]
LIMITS = ROOT / ".ci" / "budgets.toml"
PACKAGE = str(Path(kl.__file__).parent)
STEPS = 300
SLACK = 0.02
"""Share by which a count may be below its limit until that must be lowered."""


def tracked(pattern: str) -> list[Path]:
    """Files that the repository holds, as they are in the work tree."""
    names = _git("ls-files", pattern).split()
    return [path for name in names if (path := ROOT / name).is_file()]


def lines(pattern: str) -> int:
    """Lines, docstrings and comments included."""
    return sum(len(path.read_text().splitlines()) for path in tracked(pattern))


def numbers(pattern: str) -> int:
    """Names at the top of modules that hold a number, or numbers."""
    count = 0
    for path in tracked(pattern):
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.Assign):
                count += sum(map(_is_number, _values(node)))
    return count


def _values(node: ast.Assign) -> Iterator[ast.expr]:
    """What each name is assigned."""
    for target in node.targets:
        many = isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple)
        yield from node.value.elts if many else [node.value]  # type: ignore[attr-defined]


def _is_number(value: ast.expr) -> bool:
    try:
        found = ast.literal_eval(value)
    except ValueError:
        # a sum of names may be a folder, or a union of types
        inside = [n.value for n in ast.walk(value) if isinstance(n, ast.Constant)]
        known = any(isinstance(n, int | float) for n in inside)
        return isinstance(value, ast.UnaryOp) or (isinstance(value, ast.BinOp) and known)
    parts = found if isinstance(found, tuple) and found else (found,)
    return all(isinstance(p, int | float) and not isinstance(p, bool) for p in parts)


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


def measure() -> dict[str, int]:
    """All counts, by their names in the file of limits."""
    folders = ("kmpc_lite", "kmpc_lite/control", "firmware_bridge", "lab", "tests")
    counts = {f"lines of {folder}": lines(f"{folder}/*.py") for folder in folders}
    counts["lines of C"] = lines("kmpc_lite/*.c") + lines("kmpc_lite/*.h")
    for folder in folders[:-1]:
        counts[f"files of {folder}"] = len(tracked(f"{folder}/*.py"))
    for folder in folders[:2]:
        counts[f"numbers of {folder}"] = numbers(f"{folder}/*.py")
    drive = Drive()
    counts[f"functions reached in {STEPS} steps"] = functions_reached(drive)
    counts["attributes of the state"] = state_attributes(drive.controller.state, set())
    counts["words of docs"] = sum(len(path.read_text().split()) for path in tracked("docs/*.md"))
    return counts


def complaints(
    counts: Mapping[str, int], limits: Mapping[str, int], before: Mapping[str, int]
) -> list[str]:
    """What does not hold: counts and limits by name, and the limits of commits before."""
    found = []
    if counts.keys() != limits.keys():
        named = ", ".join(sorted(counts.keys() ^ limits.keys()))
        found.append(f"counts without a limit, or limits of nothing: {named}")
    for name, count in counts.items():
        limit = limits.get(name, count)
        if count > limit:
            found.append(
                f"{name}: at most {limit:,}, got {count:,}: find as many in the room itself"
            )
        elif count < (1.0 - SLACK) * limit:
            found.append(f"{name}: {count:,} are 2 % below {limit:,}: lower the limit")
    found += [
        f"{name}: the limit rose from {before[name]:,} to {limit:,}: limits only go down"
        for name, limit in limits.items()
        if limit > before.get(name, limit)
    ]
    return found


def committed() -> dict[str, int]:
    """Limits of the last two commits that set any, the lower of each."""
    name = str(LIMITS.relative_to(ROOT))
    told: list[dict[str, int]] = []
    for commit in _git("log", "-2", "--format=%H", "--", name).split():
        told.append(tomllib.loads(_git("show", f"{commit}:{name}"))["limits"])
    return {key: min(t[key] for t in told if key in t) for t in told for key in t}


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=True)
    return done.stdout


def main() -> int:
    """Print the table; 1 if something does not hold."""
    counts, limits = measure(), tomllib.loads(LIMITS.read_text())["limits"]
    wrong = complaints(counts, limits, committed())
    for name, count in counts.items():
        sys.stdout.write(f"{name:36}{count:>9,}  of {limits.get(name, 0):,}\n")
    for line in wrong:
        sys.stderr.write(f"budgets: {line}\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
