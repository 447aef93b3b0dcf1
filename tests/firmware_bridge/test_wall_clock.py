"""A wall clock that is set changes nothing."""

import ast
from pathlib import Path

import firmware_bridge


def test_no_wall_clock_decides_anything():
    """A clock that is set, by hand or by NTP, can then do nothing.

    It is read once, for logs, recordings and the stamps of signatures; ROS 2 messages carry it.
    """
    allowed = {
        "integration/recording.py": 1,
        "recording/link_log.py": 1,
        "drivers/mavlink/driver.py": 1,
        "ros2/driver.py": 1,
    }
    root, found = Path(firmware_bridge.__file__).parent, {}
    for path in root.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Attribute) and (
                ast.unparse(node) in ("time.time", "time.time_ns") or node.attr in ("now", "utcnow")
            ):
                if ast.unparse(node).startswith(("time.", "datetime.", "dt.")):
                    name = str(path.relative_to(root))
                    found[name] = found.get(name, 0) + 1
    assert found == allowed
