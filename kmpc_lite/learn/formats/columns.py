"""Which column of a table is what: our names, the user's, and those that other tools give."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from kmpc_lite.errors import DataError, did_you_mean
from kmpc_lite.learn.logs import KNOWN, spelled

COLUMNS = ("t", "x", "y", "theta", "v", "omega")
"""Columns of the tables that are written."""
CAR_OMEGA = "steered_turn_rate"
"""Turn rate of a car, as its saved logs have it: speed times the curvature of its wheels."""


class Names(NamedTuple):
    """How other tools call a column; in lower case, with underscores between the words."""

    whole: tuple[str, ...]
    endings: tuple[str, ...] = ()
    """Last words of longer names: ``pose.pose.position.x``."""


def _names(whole: str, endings: str = "") -> Names:
    """Names that are parted by blanks."""
    return Names(tuple(whole.split()), tuple(endings.split()))


def _of_wheel(side: str) -> Names:
    """Of a speed of the wheels of one side."""
    s, parts = side[0], (f"{side}{of}_{what}" for of in ("", "_wheel") for what in WHEEL)
    ends = f"{' '.join(parts)} {side}_wheel wheel_{side}"
    return _names(f"v_{side} {side}_v v{s} v_{s} cmd_{side}", ends)


WHEEL = ("speed", "vel", "velocity")
ENDS = "position_{0} pos_{0} translation_{0} pose_{0} r_{0}"
NAMES = {
    "t": _names(
        "time stamp timestamp secs sec seconds time_stamp ts elapsed", "header_stamp timestamp time"
    ),
    "x": _names("px tx pos_x x_pos east easting", ENDS.format("x")),
    "y": _names("py ty pos_y y_pos north northing", ENDS.format("y")),
    "theta": _names("yaw heading psi th phi angle orientation azimuth", "theta yaw heading"),
    "v": _names(
        "cmd_v v_cmd u_v v_ref cmd_vel linear speed velocity vel vx v_x cmd_vx vx_cmd",
        "linear_x lin_vel linear_velocity lin_x v motor_speed erpm",
    ),
    "omega": _names(
        "cmd_omega omega_cmd cmd_w w_cmd w wz angular yaw_rate yawrate turn_rate cmd_yaw_rate "
        "omega_ref u_omega u_w",
        "angular_z ang_vel angular_velocity ang_z omega yaw_rate",
    ),
    "steering": _names(
        "steering_angle delta steer steer_angle servo_angle drive_steering_angle",
        "steering_angle steering delta",
    ),
    "curvature": _names("kappa curv cmd_curvature u_kappa", "curvature kappa"),
    "servo": _names(
        "servo_position servo_pos servo1_raw servo_output rcou_c1 steering_pwm",
        "servo_position servo servo1_raw servo_position_data",
    ),
    CAR_OMEGA: _names(""),
    "lateral": _names(
        "v_y vy cmd_vy vy_cmd lateral_speed lateral_velocity linear_y", "linear_y lateral"
    ),
    "lat": _names("latitude gps_lat", "latitude lat"),
    "lon": _names("longitude lng long gps_lon", "longitude lon lng"),
    "left": _of_wheel("left"),
    "right": _of_wheel("right"),
    **{
        f"q{a}": _names(f"q_{a} rot_{a}", f"orientation_{a} rotation_{a} q_rs_{a} quat_{a}")
        for a in "xyzw"
    },
}
"""By our name; those of other kinds of robots are added here, in `KNOWN` and in `WAYS`."""
QUATERNION = ("qx", "qy", "qz", "qw")
STEERED = ("steering", "curvature", "servo", CAR_OMEGA)
"""What steers a car."""
WAYS = {
    "position": (("x", "y"), ("lat", "lon")),
    "heading": (("theta",), QUATERNION),
    "command": (
        *(("v", "omega"), ("left", "right")),
        *(("v", steered) for steered in STEERED),
    ),
}
"""Columns that say the same; the first of which all are there are taken."""
COMMANDED = ("cmd", "command", "target", "setpoint", "desired", "ref")
"""Words that tell a command from a measured speed."""
LONGEST_NAME = 100
"""Most characters of a column's name that are searched: the time that a search for brackets takes
grows with their square."""
BRACKETS = re.compile(r"\s*[\[(]\s*(?P<unit>[^\])]*?)\s*[\])]\s*$")
SUFFIX = re.compile(r"_(?P<unit>ns|us|ms|sec|deg|rad|mm|cm|mps|rpm|degps|dps|radps|kmh|kph)$")
NO_UNIT = ("", "-", "1")


@dataclass(frozen=True)
class Found:
    """Where the columns of a table are."""

    where: dict[str, int]
    """Position of each column in the table, by our name: theta, or the four parts of a quaternion.
    """
    names: dict[str, str]
    """The file's name of each column, by our name."""
    units: dict[str, str] = field(default_factory=dict)
    """Unit of each column, by our name, where the header tells one that is not SI."""
    passed_over: tuple[str, ...] = ()
    """Columns that look like commands though others were taken."""
    header: tuple[str, ...] = ()
    """Names of all the table's columns."""

    @property
    def command(self) -> tuple[str, ...]:
        """Columns of the commands; none if the table has none."""
        way = _commands(self.where.keys())
        return way if set(way) <= self.where.keys() else ()

    def shown(self, name: str) -> str:
        """Give the file's name of a column, fit for a message."""
        return short(self.names[name])

    @property
    def notes(self) -> tuple[str, ...]:
        """Which columns were taken, where that is not plain."""
        told = [
            f"{name}={short(theirs)}" + (f" [{self.units[name]}]" if name in self.units else "")
            for name, theirs in self.names.items()
            if name != theirs or name in self.units
        ]
        lines = [f"columns: {', '.join(told)}"] if told else []
        if self.passed_over:
            others = ", ".join(map(short, self.passed_over[:4]))
            taken = " and ".join(f"{name}={self.shown(name)}" for name in self.command)
            lines.append(
                f"{taken} are learned from; commands may be in {others}, too "
                "(--columns v=... omega=...)"
            )
        return tuple(lines)


def find_columns(
    file: Path,
    header: Sequence[str],
    chosen: Mapping[str, str],
    where: str,
    poses: bool = True,
    given: Collection[str] = (),
) -> Found:
    """Find t and the poses, and the commands where they are there; or t and the commands alone.

    Parameters
    ----------
    file : Path
        For messages.
    header : sequence of str
        Names of the table's columns.
    chosen : mapping
        Our name to the table's, as the user gave them.
    where : str
        Where the header stands, for messages.
    poses : bool
        Whether poses are needed; else the commands are.
    given : collection of str
        Our names of columns whose units the user gave.

    Raises
    ------
    DataError
        For columns that are missing, doubled, or of which several may be meant; for a unit that
        nobody knows.
    """
    for name in chosen:
        if name not in NAMES:
            raise DataError(f"columns: expected one of {', '.join(NAMES)}, got {name!r}")
    found: dict[str, int] = {}
    several: dict[str, list[int]] = {}
    for name in NAMES:
        places = _places(file, header, name, chosen)
        if len(places) == 1:
            found[name] = places[0]
        elif places:
            several[name] = places
    there = found.keys() | several.keys()
    commands = _commands(there)
    pose = (*_way("position", there), *_way("heading", there))
    wanted = ("t", *pose) if poses else ("t", *commands)
    missing = [name for name in wanted if name not in there]
    every = tuple(dict.fromkeys((*wanted, *commands)))
    doubled = [name for name in every if name in several]
    if missing or doubled:
        _refuse(file, header, where, missing, {n: several[n] for n in doubled})
    kept = [n for n in every if n in found]
    told = [n for n in kept if n not in given]
    units = {n: u for n in told if (u := _unit(file, n, header[found[n]]))}
    names = {n: header[found[n]] for n in kept}
    taken = set(names.values())
    others = tuple(h for h in header if h not in taken and _is_commanded(h))
    plain = all(n in names and n not in chosen and not _is_commanded(names[n]) for n in commands)
    passed_over = others if plain else ()
    return Found({n: found[n] for n in kept}, names, units, passed_over, tuple(header))


def _way(kind: str, there: Collection[str]) -> tuple[str, ...]:
    """Columns by which a table says a thing."""
    whole = (way for way in WAYS[kind] if all(name in there for name in way))
    return next(whole, WAYS[kind][0])


def _commands(there: Collection[str]) -> tuple[str, ...]:
    """Columns of the commands: of an omni the speed to the left, too."""
    way = _way("command", there)
    return ("v", "lateral", "omega") if way == ("v", "omega") and "lateral" in there else way


def _places(file: Path, header: Sequence[str], name: str, chosen: Mapping[str, str]) -> list[int]:
    """Columns that `name` may mean: by the surest rule that finds any."""
    if name in chosen:
        places = [k for k, theirs in enumerate(header) if theirs == chosen[name]]
        if not places:
            names = [short(theirs) for theirs in header]
            hint = did_you_mean(chosen[name], names) or f"; it has {listed(header)}"
            raise DataError(f"{file}: columns: {name}={short(chosen[name])}: no such column{hint}")
        return places
    exact = [k for k, theirs in enumerate(header) if theirs == name]
    if exact:
        return exact
    plain = [_plain(theirs) for theirs in header]
    for alias in (name, *NAMES[name].whole):
        if places := [k for k, theirs in enumerate(plain) if theirs == alias]:
            return places
    for ending in NAMES[name].endings:
        if places := [k for k, theirs in enumerate(plain) if f"_{theirs}".endswith(f"_{ending}")]:
            sure = [k for k in places if any(word in plain[k] for word in COMMANDED)]
            return sure if len(sure) == 1 and name in WAYS["command"][0] else places
    return []


def _is_commanded(name: str) -> bool:
    """Whether a column's name says that it holds a command."""
    return any(word in name.lower() for word in COMMANDED)


def _plain(name: str) -> str:
    """A name without its unit, in lower case, words parted by underscores."""
    bare = BRACKETS.sub("", name[:LONGEST_NAME])
    words = re.sub(r"[^0-9a-z]+", "_", bare.lower()).strip("_")
    return SUFFIX.sub("", words)


def _unit(file: Path, name: str, theirs: str) -> str | None:
    """Unit that a header tells of a column, where it is not SI."""
    theirs = theirs[:LONGEST_NAME]
    found = BRACKETS.search(theirs) or SUFFIX.search(theirs.lower().strip())
    sizes = KNOWN.get(name)
    if found is None or sizes is None or found["unit"] in NO_UNIT:
        return None
    unit = spelled(found["unit"])
    if unit not in sizes:
        raise DataError(
            f"{file}: unknown unit {short(found['unit'])!r} in column {short(theirs)!r}: expected "
            f"{', '.join(sizes)}; --units {name}=... says what it is"
        )
    return None if unit == next(iter(sizes)) else unit


def _refuse(
    file: Path,
    header: Sequence[str],
    where: str,
    missing: Sequence[str],
    doubled: Mapping[str, Sequence[int]],
) -> None:
    """Say what is missing and what is there more than once."""
    told = [f"{', '.join(missing)} missing"] if missing else []
    for name, places in doubled.items():
        names = [header[k] for k in places]
        same = len(set(names)) == 1
        may_be = " or ".join(short(n) for n in names[:3])
        told.append(f"{name} doubled" if same else f"{name} may be {may_be}")
    raise DataError(
        f"{file}: {where}: {' and '.join(told)}; expected {','.join(COLUMNS)}, got "
        f"{listed(header) or 'nothing'}; --columns {next(iter([*missing, *doubled]))}=NAME tells"
    )


def listed(header: Sequence[str]) -> str:
    """Names of a header, as far as they fit one line."""
    return short(",".join(header))


def short(text: str) -> str:
    """Make text fit for an error's one line, whatever it was read from."""
    printable = "".join(c if c.isprintable() else "?" for c in text[:61])
    return printable if len(printable) <= 60 else printable[:57] + "..."
