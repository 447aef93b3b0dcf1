"""Robot files: link, board, geometry, limits, safety, frame and control of one robot, in TOML.

Command-line options are laid over the file before anything is checked, so both go the same way.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from firmware_bridge.drivers.boards import BOARDS
from firmware_bridge.messages import ConfigError
from firmware_bridge.options import bounded, check, from_table, three_numbers
from firmware_bridge.robot_checks import check_kind, check_period, check_wheels
from firmware_bridge.safety.gate_settings import TICK, GateSettings, Limits
from firmware_bridge.sensors.lidar.options import LidarOptions
from firmware_bridge.sensors.pose import check_pose_url
from firmware_bridge.wheels import TWO_SIDES, Wheels, read_wheels
from kmpc_lite.reading import read_toml

DRIVERS = tuple(BOARDS)
TOPICS = "ros2"  # in place of a driver where ROS 2 topics are the robot's link: see `kmpc ros2`
SECTIONS = ("link", "board", "geometry", "limits", "safety", "frame", "control", "lidar", "robot")
NOMINAL_LATENCY = {**{name: board.latency for name, board in BOARDS.items()}, TOPICS: 0.1}
"""Default for a model without input history [s], by driver."""


@dataclass(frozen=True)
class RobotOptions:
    """The ``[robot]`` section."""

    name: str | None = None
    """Of this vehicle; its recordings carry it, and a model of another name is refused."""
    footprint: Any = None
    """What it covers about its pose: length, width and ahead [m], or corners; as read."""
    wheels: Any = None
    """What it drives on: a kind, or a table of it: `firmware_bridge.wheels.Wheels`."""

    def __post_init__(self) -> None:
        """Check the length."""
        if self.name is not None and not 0 < len(self.name) <= 100:
            raise ConfigError(f"name: expected 1 to 100 characters, got {len(self.name)}")


@dataclass(frozen=True)
class LinkOptions:
    """The ``[link]`` section."""

    url: str  # serial:PATH?baud=..., pty:PATH, tcp:HOST:PORT or udp:HOST:PORT
    driver: str
    timeout: float = bounded(0.1, 300.0, "s", 10.0)  # how long the board may take to answer [s]
    pose: str | None = None
    """udp:HOST:PORT where poses from outside arrive; an autopilot is fed with them, else they
    replace the wheels' odometry."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.driver not in (*DRIVERS, TOPICS):
            raise ConfigError(f"driver: expected {', '.join(DRIVERS)}, got {self.driver!r}")
        check(self)
        if self.pose is not None:
            check_pose_url(self.pose)


@dataclass(frozen=True)
class ControlOptions:
    """The ``[control]`` section."""

    period: float | None = bounded(0.01, 1.0, "s", None)
    """Of the controller [s]; the model's if not given."""
    command_period: float = bounded(TICK, 0.2, "s", TICK)
    """Of commands on the wire while driving [s]."""
    latency: float | None = bounded(0.0, 0.5, "s", None)
    """From a command on the wire to the wheels [s]; if not given `NOMINAL_LATENCY` for a model
    that knows no lag, else 0."""
    model: str | None = None  # file of a learned model; the nominal unicycle if not given
    adaptation: bool | None = None
    """Whether a learned model is corrected while driving where the floor contradicts it; if not
    given, that of a robot whose wheels are not steered. The nominal one, which knows no lag, never
    is."""
    map: bool = True
    """Whether the controller knows the scenario's obstacles; without, it drives by its lidar
    alone."""
    trust_model: bool = False
    """Whether a model is driven although it is another vehicle's, of another period, or learned
    from slower driving."""
    scenario: str | None = None  # scenario file, or the name of one that comes with kmpc_lite

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)


@dataclass(frozen=True)
class Robot:
    """A checked robot file."""

    where: str  # what to call it in messages
    link: LinkOptions
    gate: GateSettings
    control: ControlOptions
    origin: tuple[float, float, float] | None = None
    """Pose of the vehicle's own frame in the scenario's [m, m, rad]; None: the scenario's start for
    wheel odometry, else zero."""
    socket: Path | None = None  # of the emergency stop; the user's default if not given
    lidar: LidarOptions | None = None  # its lidar, without fresh scans of which it does not drive
    sections: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """As read; `board` and `geometry` are checked by the driver."""
    name: str | None = None
    footprint: Any = None  # both of the vehicle: `RobotOptions`
    wheels: Wheels = TWO_SIDES  # what it drives on

    @property
    def vehicle(self) -> dict[str, str | float | bool]:
        """What a model learned on this vehicle depends on: plain values."""
        named = {} if self.name is None else {"name": self.name}
        geometry = self.sections.get("geometry", {})
        poses = "own" if self.link.pose is None else "from outside"
        return {
            **named,
            "driver": self.link.driver,
            "poses": poses,
            **self.wheels.vehicle,
            **{k: str(v) if isinstance(v, list) else v for k, v in geometry.items()},
        }

    @property
    def is_autopilot(self) -> bool:
        """Whether the board has a pilot, modes and a pose of its own."""
        return self.link.driver == "mavlink"

    def driver_table(self) -> Mapping[str, Any]:
        """Give the driver's `from_options` what it takes."""
        board, geometry = self.sections.get("board", {}), self.sections.get("geometry", {})
        if self.is_autopilot and geometry:
            raise ConfigError("[geometry]: an autopilot has its own; leave the section out")
        if self.is_autopilot and self.link.pose is not None:
            if board.get("pose", "mocap") != "mocap":
                raise ConfigError(
                    f'board.pose: {board["pose"]!r} contradicts link.pose: expected "mocap", '
                    "or leave it out"
                )
            board = {**board, "pose": "mocap"}
        entry = BOARDS.get(self.link.driver)
        if entry is not None and not entry.encoders and self.link.pose is None:
            raise ConfigError(
                f"link.pose: missing: a {entry.label} has no encoders; give --pose udp:HOST:PORT, "
                "where motion capture sends"
            )
        if self.wheels.kind == "car" and not self.is_autopilot:
            geometry = {**geometry, **self.wheels.steering}
        return {"board": board, "geometry": geometry, "wheels": self.wheels.kind}


def load_robot(
    path: str | os.PathLike[str] | None, overrides: Mapping[str, Mapping[str, Any]] | None = None
) -> Robot:
    """Read a robot file.

    `path`: None if all comes from the command line. `overrides`: sections and keys that replace
    those of the file; None as a value replaces nothing. Raises ConfigError: names file, section and
    key.
    """
    where, table = ("command line", {}) if path is None else (str(path), _read(Path(path)))
    sections: dict[str, dict[str, Any]] = {}
    for name in (*table, *(overrides or {})):
        if name not in SECTIONS:
            raise ConfigError(
                f"{where}: unknown section [{name}]; expected "
                f"{', '.join(f'[{s}]' for s in SECTIONS)}"
            )
        content = table.get(name, {})
        if not isinstance(content, Mapping):
            raise ConfigError(f"{where}: [{name}] must be a section, got {content!r}")
        given = {k: v for k, v in (overrides or {}).get(name, {}).items() if v is not None}
        sections[name] = {**content, **given}
    try:
        return _robot(where, sections)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from None


def _read(path: Path) -> dict[str, Any]:
    try:
        return read_toml(path)
    except OSError as error:
        raise ConfigError(
            f"{path}: cannot read the robot file: {error.strerror or error}"
        ) from error
    except ValueError as error:
        raise ConfigError(f"{path}: not TOML: {error}") from error


def _robot(where: str, sections: Mapping[str, Mapping[str, Any]]) -> Robot:
    vehicle = from_table(RobotOptions, sections.get("robot", {}), "robot")
    link_table = sections.get("link", {})
    for key, option in (("url", "--link URL"), ("driver", "--driver NAME")):
        if key not in link_table:
            raise ConfigError(f"link.{key}: missing: give {option}, or a robot file")
    link = from_table(LinkOptions, link_table, "link")
    control = from_table(ControlOptions, sections.get("control", {}), "control")
    limits = from_table(Limits, sections.get("limits", {}), "limits")
    safety = dict(sections.get("safety", {}))
    socket = safety.pop("socket", None)
    if socket is not None and not isinstance(socket, str):
        raise ConfigError(f"safety.socket: expected a path, got {socket!r}")
    settings = [f.name for f in fields(GateSettings) if f.name not in ("limits", "pilot")]
    for key in safety:
        if key not in settings:
            raise ConfigError(
                f"safety.{key}: unknown key; [safety] takes {', '.join(settings)}, socket"
            )
    if isinstance(safety.get("geofence"), list):
        safety["geofence"] = tuple(safety["geofence"])
    try:
        gate = GateSettings(limits=limits, pilot=link.driver == "mavlink", **safety)
    except ConfigError as error:
        raise ConfigError(f"safety.{error}") from None
    except TypeError:  # a geofence that is no list
        raise ConfigError(
            f"safety.geofence: expected [xmin, ymin, xmax, ymax] in m, got {safety['geofence']!r}"
        ) from None
    if control.period is not None:
        check_period(control.period, gate)
    geometry = sections.get("geometry", {})
    wheels = read_wheels(vehicle.wheels, geometry)
    check_kind(wheels.kind, BOARDS.get(link.driver), limits)
    check_wheels(sections.get("limits", {}), geometry)
    return Robot(
        where,
        link,
        gate,
        control,
        _origin(sections.get("frame", {})),
        None if socket is None else Path(socket),
        _lidar(sections.get("lidar", {})),
        sections,
        vehicle.name,
        vehicle.footprint,
        wheels,
    )


def _lidar(table: Mapping[str, Any]) -> LidarOptions | None:
    if not table:
        return None
    if "driver" not in table:
        raise ConfigError("lidar.driver: missing: give --lidar NAME")
    return LidarOptions.from_table(table)


def _origin(frame: Mapping[str, Any]) -> tuple[float, float, float] | None:
    for key in frame:
        if key != "origin":
            raise ConfigError(f"frame.{key}: unknown key; [frame] takes origin")
    origin = frame.get("origin")
    if origin is None:
        return None
    numbers = three_numbers(origin)
    if numbers is None:
        raise ConfigError(f"frame.origin: expected [x, y, theta] in m and rad, got {origin!r}")
    return numbers
