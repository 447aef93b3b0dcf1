"""What a log holds, in whatever format it came: poses, commands, their units and frames."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import pi
from pathlib import Path
from typing import NamedTuple

import numpy as np

from kmpc_lite.errors import DataError, did_you_mean
from kmpc_lite.types import INPUTS, Array

FRAMES = ("enu", "ned", "swapped")
"""enu: x east, y north, theta counter-clockwise from x. ned: x north, y east, theta clockwise from
north. swapped: x and y exchanged, theta as it should be."""
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0}
LENGTH = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "ft": 0.3048, "in": 0.0254}
ANGLE = {"rad": 1.0, "deg": pi / 180.0, "cdeg": pi / 18000.0, "mrad": 1e-3, "rev": 2.0 * pi}
SPEED = {
    **{f"{name}/s": size for name, size in LENGTH.items()},
    "km/h": 1.0 / 3.6,
    "mph": 0.44704,
    "kn": 1852.0 / 3600.0,
}
TURN_RATE = {**{f"{name}/s": size for name, size in ANGLE.items()}, "rpm": pi / 30.0}
PLACE = {"deg": 1.0, "rad": 180.0 / pi}
"""Of a latitude or a longitude, which are kept in degrees until they become metres."""
KNOWN = {
    **{"t": TIME, "x": LENGTH, "y": LENGTH, "theta": ANGLE, "v": SPEED, "omega": TURN_RATE},
    "steered_turn_rate": TURN_RATE,
    **dict.fromkeys(("left", "right"), {**SPEED, **TURN_RATE}),
    **{"lat": PLACE, "lon": PLACE, "lateral": SPEED},
    **{"steering": ANGLE, "curvature": {"1/m": 1.0, "1/cm": 100.0, "1/mm": 1000.0}},
    "servo": {"1": 1.0, "%": 0.01},
}
"""Size of each unit, by column; of wheels that turn for a radius of 1 m."""
WORDS = {
    **dict.fromkeys(("sec", "secs", "second", "seconds"), "s"),
    **{"msec": "ms", "usec": "us", "µs": "us"},
    **dict.fromkeys(("nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds"), "ns"),
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **{"inch": "in", "inches": "in", "foot": "ft", "feet": "ft", "hour": "h", "hr": "h"},
    **{"degree": "deg", "degrees": "deg", "degs": "deg", "°": "deg"},
    **{"radian": "rad", "radians": "rad", "rads": "rad"},
}
WHOLE = {
    **{
        "mps": "m/s",
        "cmps": "cm/s",
        "mmps": "mm/s",
        "ips": "in/s",
        "fps": "ft/s",
        "kph": "km/h",
        "kmh": "km/h",
        "kmph": "km/h",
    },
    **{"degps": "deg/s", "dps": "deg/s", "radps": "rad/s", "rev/min": "rpm", "knots": "kn"},
}
"""Other spellings, of parts of units and of whole ones."""


def spelled(text: str) -> str:
    """A unit as it is written here, whatever its case and spelling.

    Examples
    --------
    >>> spelled("deg/sec"), spelled("Meters"), spelled("IPS"), spelled("furlong")
    ('deg/s', 'm', 'in/s', 'furlong')
    """
    bare = text.strip().lower().replace(" ", "").replace("per", "/")
    parts = "/".join(WORDS.get(part, part) for part in bare.split("/"))
    return WHOLE.get(parts, parts)


LARGEST = 1e9
"""Largest number of a pose or a command [m, rad, m/s, rad/s]: differences of larger ones are lost
to rounding, and their squares overflow."""
ALIKE = 1.3  # factor within which a size is that of a unit
FORM = re.compile(
    r"(?P<sign>-?)(?P<unit>1?[a-zA-Z/%]+|[0-9.]+(?:e-?[0-9]+)?)(?P<offset>[+-][0-9.]+)?"
)


class Unit(NamedTuple):
    """How a column becomes SI: ``scale * value + offset``."""

    scale: float
    offset: float = 0.0

    def apply(self, values: Array) -> Array:
        """Convert values (n,)."""
        return self.scale * values + self.offset


def parse_units(units: Mapping[str, str]) -> dict[str, Unit]:
    """Read units by column: ``ns``, ``-rad`` for the other direction, ``-deg+90`` with an offset.

    A number instead of a name is the unit's size: ``0.0025`` [m/s] for steps of a motor's board.

    Raises DataError for a column or a unit that nobody knows.

    Examples
    --------
    >>> parse_units({"t": "ms", "theta": "-deg+90"})["t"]
    Unit(scale=0.001, offset=0.0)
    """
    return {column: _parse_unit(column, text) for column, text in units.items()}


def _parse_unit(column: str, text: str) -> Unit:
    """One unit."""
    if (known := KNOWN.get(column)) is None:
        raise DataError(f"units: expected one of {', '.join(KNOWN)}, got {column!r}")
    found = FORM.fullmatch(text)
    name = spelled(found["unit"]) if found else text
    try:
        size = known.get(name) or float(name)
    except ValueError:
        size = 0.0
    if found is None or not size:
        hint = did_you_mean(name, known) or f"; choose from {', '.join(known)}"
        such = "deg, -rad or -deg+90" if column == "theta" else f"{list(known)[1]} or -0.5"
        raise DataError(f"units: {column}={text}: expected a unit such as {such}{hint}")
    return Unit(-size if found["sign"] else size, float(found["offset"] or 0.0) * size)


def reread(column: str, text: str | None, factor: float, offset: float = 0.0) -> str | None:
    """Unit that makes of a column `factor` times what it was, and an offset more [SI].

    `text`: by which it was read; SI if not given. Gives None if no unit that is known does.

    Examples
    --------
    >>> reread("v", "mm/s", 990.0), reread("theta", "deg", -1.0, pi / 2.0), reread("y", None, 7.0)
    ('m/s', '-deg+90', None)
    """
    sizes = KNOWN[column]
    scale, before = (1.0, 0.0) if text is None else _parse_unit(column, text)
    size = abs(factor * scale)
    off, name = min((abs(np.log(known / size)), name) for name, known in sizes.items())
    if off > np.log(ALIKE):
        if abs(factor) != 1.0:
            return None
        name = f"{size:.6g}"  # as it was given
    size = sizes.get(name, size)
    turned = (np.sign(factor) * before + offset) / size
    told = f"{turned:+.{0 if size < 0.1 else 4}f}" if abs(turned) > 1e-3 else ""
    return ("-" if factor * scale < 0.0 else "") + name + told


@dataclass(frozen=True, eq=False)
class Series:
    """Values and the times at which they were true."""

    time: Array  # (n,) [s]
    values: Array  # poses x, y, theta or commands v, omega, (n, 3) or (n, m)
    source: str  # where they were found: ``/odom (nav_msgs/msg/Odometry)``


class Topic(NamedTuple):
    """One stream of messages in a file."""

    name: str
    kind: str  # type of its messages
    messages: int
    rate: float | None  # messages a second; None if the file does not tell [Hz]


@dataclass(frozen=True, eq=False)
class Log:
    """One file's poses and commands, as they were logged: nothing resampled, nothing unwrapped."""

    name: str  # the file, for messages
    poses: Series
    commands: Series
    together: bool = False
    """Whether row k of both is one row of a table, whose command is held until the next row."""
    measured: bool = False  # whether the commands are measured speeds, for lack of commands
    topics: tuple[Topic, ...] = ()  # all that is in the file, used or not
    notes: tuple[str, ...] = ()  # what a user should know of how the file was read, one line each
    where: Callable[[int], str] = "row {}".format  # names a row as the file does: ``line 7``
    columns: tuple[str, ...] = ("v", "omega")
    """What the numbers of a command are: v and omega; v, lateral and omega; v and steering..."""
    steered: bool = False
    """Whether the commands are a car's: turn rates are speeds times the curvature of its wheels."""
    units: Mapping[str, str] = field(default_factory=dict)
    """Units by which columns were read, by our names: the header's, or the user's."""
    wheel_speeds: bool = False
    """Whether v and omega were made of the speeds of a left and a right wheel."""
    geometry: Mapping[str, float] = field(default_factory=dict)
    """Wheelbase or track, as far as they are known [m]."""
    shares: bool = False
    """Whether the commands are shares of full throttle and steering: their size tells nothing."""

    @property
    def span(self) -> float:
        """Time between the first and the last pose [s]."""
        return float(self.poses.time[-1] - self.poses.time[0])

    def unit(self, column: str, factor: float = 1.0, offset: float = 0.0) -> str | None:
        """Option that makes of a column `factor` times what it was, and an offset more [SI]."""
        told = reread(column, self.units.get(column), factor, offset)
        return told and f"{column}={told}"


@dataclass(frozen=True)
class ReadOptions:
    """How files are to be read, as far as they do not tell themselves.

    Raises DataError for units, frames or names that nobody knows.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    """Of tables: our name to the file's, ``{"theta": "yaw"}``."""
    topics: Mapping[str, str] = field(default_factory=dict)
    """Of bags and autopilots' logs: ``{"odom": "/odom", "cmd": "/cmd_vel"}``."""
    units: Mapping[str, str] = field(default_factory=dict)
    """``{"t": "ns", "theta": "-deg+90"}``; see `parse_units`."""
    frame: str = "enu"  # how the poses lie: enu, ned or swapped; see `FRAMES`
    commands: Path | None = None  # a table of commands, for logs that hold poses only
    track: float | None = None
    """Distance between left and right wheels, for commands that are their speeds [m]."""
    wheel_radius: float | None = None  # of wheels whose speeds are given as turns: rpm, rad/s [m]
    wheelbase: float | None = None
    """Distance between the axles of a car, for commands that are steering angles [m]; found from
    how the poses turn if not given."""
    shift: float = 0.0  # added to the times of the commands, where their clock is another [s]
    force: bool = False  # whether times that run back are cut rather than refused
    spacing: float = 0.005  # messages of a stream that come closer than this are left out [s]
    progress: Callable[[int, int], None] | None = None
    """Called now and then with how much of a large file has been read, and how much there is."""

    def __post_init__(self) -> None:
        """Check the names once."""
        for name in self.topics:
            if name not in ("odom", "cmd"):
                raise DataError(f"topics: expected odom=... or cmd=..., got {name!r}")
        if self.frame not in FRAMES:
            raise DataError(f"frame: expected {', '.join(FRAMES)}, got {self.frame!r}")
        if not np.isfinite(self.shift):
            raise DataError(f"shift: expected a time in s, got {self.shift}")
        for name in ("track", "wheelbase", "wheel_radius"):
            length = getattr(self, name)
            if length is not None and not 0.0 < length < np.inf:
                raise DataError(f"{name}: expected a distance > 0 m, got {length}")
        parse_units(self.units)


def correct(log: Log, options: ReadOptions) -> Log:
    """Bring a log into s, m, rad, x east, y north, theta counter-clockwise from east."""
    poses = in_units(log.poses, ("x", "y", "theta"), options.units)
    if options.frame != "enu":
        x, y, theta = poses.values.T
        heading = 0.5 * np.pi - theta if options.frame == "ned" else theta
        poses = replace(poses, values=np.column_stack([y, x, heading]))
    commands = in_units(log.commands, log.columns, options.units)
    commands = replace(commands, time=commands.time + options.shift)
    together, units = log.together and options.shift == 0.0, {**log.units, **options.units}
    return replace(log, poses=poses, commands=commands, together=together, units=units)


def in_units(series: Series, names: tuple[str, ...], given: Mapping[str, str]) -> Series:
    """Give a series in SI units, from those that are given by column."""
    units = parse_units({name: unit for name, unit in given.items() if name in ("t", *names)})
    values, same = series.values.copy(), Unit(1.0)
    for k, name in enumerate(names):
        values[:, k] = units.get(name, same).apply(values[:, k])
    return replace(series, time=units.get("t", same).apply(series.time), values=values)


def speeds_of(log: Log) -> Array:
    """Commands v and omega (n, 2); an omni's v is complex, ahead + i left."""
    told = log.commands.values
    if told.shape[1] == INPUTS:
        return told
    return np.column_stack([told[:, 0] + 1j * told[:, 1], told[:, 2]])
