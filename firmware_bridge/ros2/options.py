"""What the node listens to, and how far it believes it: its ROS parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from firmware_bridge.messages import ConfigError
from firmware_bridge.options import bounded, check, from_table, three_numbers
from firmware_bridge.robot_file import SECTIONS

OWN = ("use_sim_time", "start_type_description_service")
"""Parameters of rclpy itself; `qos_overrides` too."""


@dataclass(frozen=True)
class Ros2Options:
    """Parameters of the node, beside the keys of a robot file (``limits.v_max``)."""

    global_frame: str = "map"
    """Frame in which the robot is driven: that of maps and goals. The odometry's: no localisation.
    """
    use_amcl_pose: bool = False
    """Whether `amcl_pose` says where the odometry's frame lies, instead of TF."""
    scans: str = "scan"
    """Topics of scanners, separated by blanks; empty: none. It drives only by fresh ones."""
    maps: str = "map"
    """Topics of occupancy grids, separated by blanks; empty: none. It waits for each."""
    scan_mount: Any = None
    """x, y [m] and heading [rad] of the scanner on the robot; of TF if not given."""
    map_age: float = bounded(0.0, 1e6, "s", 0.0)
    """Oldest map to drive by [s]; 0: any, since a map server sends it once."""
    map_threshold: float = bounded(1.0, 100.0, "", 65.0)
    """Cells from this value on are occupied; 100 for a costmap, whose lower values are inflated."""
    unknown_is_free: bool = False  # whether the robot may drive through unknown cells of a map
    transform_tolerance: float = bounded(0.1, 60.0, "s", 2.0)
    """A transform that moves and is older is not believed [s]."""
    enable_stamped_cmd_vel: bool = False
    """Whether commands are TwistStamped, as Nav2's are from Kilted on."""
    follow_plan: bool = False
    """Whether the path is that of another planner, on `plan`, and its end the goal."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)
        if self.scan_mount is not None and three_numbers(list(self.scan_mount)) is None:
            raise ConfigError(f"scan_mount: expected [x, y, theta], got {self.scan_mount!r}")


def read_parameters(given: Mapping[str, Any]) -> tuple[Ros2Options, dict[str, dict[str, Any]]]:
    """Read ROS parameters: the node's own, and those that are keys of a robot file.

    Raises ConfigError for a name that is neither, or a value of another type.

    Examples
    --------
    >>> options, keys = read_parameters({"scans": "", "limits.v_max": 0.4})
    >>> options.scans, keys
    ('', {'limits': {'v_max': 0.4}})
    """
    own: dict[str, Any] = {}
    keys: dict[str, dict[str, Any]] = {}
    names = [entry.name for entry in fields(Ros2Options)]
    for name, value in given.items():
        section, dot, key = name.partition(".")
        if name in OWN or section == "qos_overrides":
            continue
        if dot and section in SECTIONS:
            keys.setdefault(section, {})[key] = value
        elif name in names:
            own[name] = value
        else:
            raise ConfigError(
                f"parameter {name}: unknown; expected a key of a robot file such as limits.v_max, "
                f"or {', '.join(names)}"
            )
    return from_table(Ros2Options, own, "parameter"), keys
