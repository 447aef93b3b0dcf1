"""Optional dependencies: reported by name, with the line that installs them, before any work."""

from __future__ import annotations

from importlib import metadata
from importlib.util import find_spec
from typing import Any

from kmpc_lite.errors import KmpcError

BRIDGE, LOGS, PLOT = "kmpc-lite[bridge]", "kmpc-lite[logs]", "kmpc-lab[plot]"
EXTRAS = {
    "PIL": PLOT,
    "casadi": "kmpc-lab[peers]",
    "jinja2": PLOT,
    "matplotlib": PLOT,
    "mujoco": "kmpc-lab[twin]",
    "mcap": BRIDGE,
    "pymavlink": BRIDGE,
    "pyulog": LOGS,
    "rclpy": "kmpc-lite[ros2-test]",
    "serial": BRIDGE,
    "rosbags": LOGS,
}
"""Distribution and extra of it that bring a module."""
LAB_LINE = "pip install kmpc-lab"
PARTS = "kmpc.parts"
"""Entry points of what kmpc-lab adds to a command of the robot."""


class MissingExtra(KmpcError):
    """An optional dependency is not installed."""


def is_installed(module: str) -> bool:
    """Whether a module can be imported; it is not."""
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def need(what: str, *modules: str) -> None:
    """Refuse where a module is missing.

    `what`: which needs it: "a report". `modules`: names of `EXTRAS`. Raises MissingExtra with the
    line that installs it.
    """
    for module in modules:
        if not is_installed(module):
            raise MissingExtra(f"{what} needs {module}: {pip_line(module)}")


def missing_extra(error: ModuleNotFoundError) -> str | None:
    """What to say of a module that was not found; None if it belongs to no extra."""
    module = (error.name or "").partition(".")[0]
    return f"{module} is not installed: {pip_line(module)}" if module in EXTRAS else None


def pip_line(module: str) -> str:
    """Command that installs the extra of a module."""
    return f"pip install '{EXTRAS[module]}'"


def part(what: str, name: str) -> Any:
    """Load what kmpc-lab adds to a command.

    `what`: which needs it: "--plot". `name`: of its entry point among `PARTS`. Raises MissingExtra
    where kmpc-lab is not installed, with the line that installs it.
    """
    for point in metadata.entry_points(group=PARTS, name=name):
        return point.load()
    raise MissingExtra(f"{what} comes with kmpc-lab: {LAB_LINE}")
