"""What `kmpc ros2` listens to and how far it believes it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from firmware_bridge.messages import ConfigError
from firmware_bridge.options import bounded, check
from firmware_bridge.ros2.names import resolve
from firmware_bridge.ros2.obstacles import GridOptions
from firmware_bridge.wheels import Wheels

TOPICS = {
    "odom": "odom",
    "tf": "/tf",
    "tf_static": "/tf_static",
    "clock": "/clock",
    "goal": "goal_pose",
    "scan": "scan",
    "map": "map",
    "cmd_vel": "cmd_vel",
    "plan": "kmpc/plan",
    "markers": "kmpc/markers",
    "diagnostics": "/diagnostics",
}
"""Names of the topics by what they are for, as Nav2 has them; /plan is that of Nav2's planner."""
SEVERAL = ("scan", "map")
"""Of these there may be several topics, or none."""
OPTIONAL = (*SEVERAL, "plan", "markers", "diagnostics", "goal")
"""These may be left out."""
MOST = 4
"""Topics of one kind."""


@dataclass(frozen=True)
class Ros2Options:
    """Options of the node."""

    topics: dict[str, tuple[str, ...]] = field(default_factory=dict)
    """Names from the root, by what they are for: see `TOPICS`."""
    frame: str = "map"
    """Frame in which the robot is driven: that of map and goal."""
    base: str = "base_link"
    """The robot's frame, where TF alone tells its pose."""
    pose_from_tf: bool = False
    """Whether TF alone tells the pose; there is no odometry topic then."""
    stamped: bool = False
    """Whether commands are TwistStamped."""
    wheels: Wheels = field(default_factory=Wheels)
    """Of the robot; a car with a wheelbase is commanded by AckermannDriveStamped."""
    simulated_time: bool = False
    """Whether stamps are of /clock: use_sim_time."""
    scan_age: float = bounded(0.05, 5.0, "s", 0.5)
    """Oldest scan to drive by [s]."""
    transform_age: float = bounded(0.1, 60.0, "s", 2.0)
    """A transform that moves and has not come for so long is not believed [s]."""
    mount: tuple[float, float, float] | None = None
    """Where the scanner sits on the robot: x, y [m], heading [rad]; of TF if not given."""
    grid: GridOptions = field(default_factory=GridOptions)

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)

    def topic(self, role: str) -> str | None:
        """Name of the one topic for something; None if it is left out."""
        names = self.topics[role]
        return names[0] if names else None


def read_topics(given: Iterable[str], namespace: str) -> dict[str, tuple[str, ...]]:
    """Read ``--topic ROLE=NAME``: names from the root, of all roles.

    Examples
    --------
    >>> topics = read_topics(["odom=/wheels/odom", "scan="], "/robot")
    >>> topics["odom"], topics["scan"], topics["goal"]
    (('/wheels/odom',), (), ('/robot/goal_pose',))

    Raises
    ------
    ConfigError
        For a role that there is not, a name that is none, or too many of them.
    """
    chosen: dict[str, list[str]] = {}
    for item in given:
        role, equals, name = item.partition("=")
        if not equals or role not in TOPICS:
            raise ConfigError(
                f"--topic {item[:80]}: expected ROLE=NAME with a role of {', '.join(TOPICS)}"
            )
        names = chosen.setdefault(role, [])
        if name:
            names.append(name)
        if len(names) > (MOST if role in SEVERAL else 1):
            most = MOST if role in SEVERAL else 1
            raise ConfigError(f"--topic {item[:80]}: {role}: at most {most} may be given")
        if not names and role not in OPTIONAL:
            raise ConfigError(f"--topic {role}=: this topic cannot be left out")
    return {
        role: tuple(
            resolve(name, namespace, f"--topic {role}") for name in chosen.get(role, [usual])
        )
        for role, usual in TOPICS.items()
    }
