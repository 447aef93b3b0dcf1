"""Which column of a table is what: our names, the user's, and those that other tools give."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from kmpc_lite.errors import DataError, did_you_mean
from kmpc_lite.learn.logs import KNOWN, spelled

COLUMNS = ("t", "x", "y", "theta", "v", "omega")  # columns of the tables that are written
CAR_OMEGA = "steered_turn_rate"
"""Turn rate of a car, as its saved logs have it: speed times the curvature of its wheels."""
QUATERNION = ("qx", "qy", "qz", "qw")
STEERED = ("steering", "curvature", "servo", CAR_OMEGA)  # what steers a car
WAYS = {
    "position": (("x", "y"), ("lat", "lon")),
    "heading": (("theta",), QUATERNION),
    "command": (("v", "omega"), ("left", "right"), *(("v", steered) for steered in STEERED)),
}
"""Columns that say the same; the first of which all are there are taken."""
_PLACE = "position_{0} pos_{0} translation_{0} pose_{0} r_{0}"
_WHEEL = "v_{1} {0}_v v{1} cmd_{1} v_{0} v{0} speed_{0} vel_{0} | " + " ".join(
    f"{{0}}{of}_{what}" for of in ("", "_wheel", "_motor") for what in ("speed", "vel", "velocity")
)
_TOLD = {
    "t": "time stamp timestamp secs sec seconds time_stamp ts elapsed datetime date_time date "
    "| header_stamp timestamp time",
    "x": "px tx pos_x x_pos x_position east easting | " + _PLACE.format("x"),
    "y": "py ty pos_y y_pos y_position north northing | " + _PLACE.format("y"),
    "theta": "yaw heading psi th phi angle orientation azimuth | theta yaw heading",
    "v": "u_v linear speed velocity vel vx v_x | linear_x lin_vel linear_velocity linear_vel "
    "vel_linear lin_x v motor_speed drive_speed erpm",
    "omega": "w wz angular yaw_rate yawrate turn_rate u_omega u_w | angular_z ang_vel "
    "angular_velocity angular_vel vel_angular ang_z omega yaw_rate",
    "steering": "steering_angle delta steer steer_angle servo_angle drive_steering_angle "
    "| steering_angle steering delta",
    "curvature": "kappa curv u_kappa | curvature kappa",
    "servo": "servo_position servo_pos servo1_raw servo_output rcou_c1 steering_pwm "
    "| servo_position servo servo1_raw servo_position_data",
    CAR_OMEGA: "|",
    "lateral": "v_y vy lateral_speed lateral_velocity linear_y | linear_y lateral",
    "lat": "latitude gps_lat | latitude lat",
    "lon": "longitude lng long gps_lon | longitude lon lng",
    "left": _WHEEL.format("left", "l") + " left_wheel wheel_left",
    "right": _WHEEL.format("right", "r") + " right_wheel wheel_right",
    **{f"q{a}": f"q_{a} rot_{a} | orientation_{a} rotation_{a} q_rs_{a} quat_{a}" for a in "xyzw"},
}
NAMES = {ours: tuple(part.split() for part in told.split("|")) for ours, told in _TOLD.items()}
"""How other tools call a column, in lower case with underscores: whole names, last words of longer
ones (``pose.pose.position.x``). Those of other robots are added here, in `KNOWN` and in `WAYS`."""
OWNERS = "robot rover car vehicle agent odom odometry base base_link ekf est true gt current actual"
OWNED = {f"{owner}_{n}": n for owner in OWNERS.split() for n in ("x", "y")}
"""Places by whose they are: of several that are there none is better than the others."""
COMMANDED = ("cmd", "command", "commanded", "target", "setpoint")
"""Words that tell a command from a measured speed, ..."""
WANTED = (*COMMANDED, "desired", "ref", "reference")
"""... and those that may tell it from what a path was to be driven at."""
MEASURED = "no commands are logged: measured speeds stand in for them, without the motors' lag"
LONGEST_NAME = 100  # most characters of a column's name that are searched for a unit
BRACKETS = re.compile(r"\s*[\[(]\s*(?P<unit>[^\])]*?)\s*[\])]\s*$")
SUFFIXES = "ns us ms sec deg rad mm cm mps rpm degps dps radps kmh kph".split()
"""Units without brackets, whatever they stand behind; others count where they fit the column."""


@dataclass(frozen=True)
class Found:
    """Where the columns of a table are, by our name; a quaternion in the place of theta."""

    where: dict[str, int]
    names: dict[str, str]  # the file's names
    units: dict[str, str]  # units that the header tells, where they are not SI
    command: tuple[str, ...]  # columns of the commands; none if the table has none
    header: tuple[str, ...]  # names of all the table's columns

    def shown(self, name: str) -> str:
        """Give the file's name of a column, fit for a message."""
        return short(self.names[name])

    def notes(self, chosen: Collection[str]) -> tuple[str, ...]:
        """Which columns were taken, where that is not plain, and what else may hold commands."""
        told = [
            f"{name}={short(theirs)}" + (f" [{self.units[name]}]" if name in self.units else "")
            for name, theirs in self.names.items()
            if name != theirs or name in self.units
        ]
        lines = [f"columns: {', '.join(told)}"] if told else []
        own = [self.names[name] for name in self.command if name not in chosen]
        others = [h for h in self.header if _is_commanded(h) and h not in self.names.values()]
        if own and others and len(own) == len(self.command) and not any(map(_is_commanded, own)):
            taken = " and ".join(f"{name}={self.shown(name)}" for name in self.command)
            lines.append(
                f"{taken} are learned from; commands may be in {', '.join(map(short, others[:4]))},"
                " too (--columns v=... omega=...)"
            )
        return tuple(lines)

    def measured(self, chosen: Collection[str]) -> bool:
        """Whether the commands are what an odometry message measured, and nobody chose them."""
        own = [self.names[name] for name in self.command if name not in chosen]
        return bool(own) and all(re.search(r"twist\Wtwist", name) for name in own)


def find_columns(
    file: Path,
    header: Sequence[str],
    chosen: Mapping[str, str],
    where: str,
    poses: bool = True,
    given: Collection[str] = (),
) -> Found:
    """Find t and the poses, and the commands where they are there; or t and the commands alone.

    `file`: for messages. `header`: names of the table's columns. `chosen`: our name to the table's,
    as the user gave them. `where`: where the header stands, for messages. `poses`: whether poses
    are needed; else the commands are. `given`: our names of columns whose units the user gave.
    Raises DataError for columns that are missing, doubled, or of which several may be meant; for a
    unit that nobody knows.
    """
    for name in chosen:
        if name not in NAMES:
            raise DataError(f"columns: expected one of {', '.join(NAMES)}, got {name!r}")
    there = {n: places for n in NAMES if (places := _places(file, header, n, chosen))}
    speeds = {n for way in WAYS["command"] for n in (*way, "lateral")}
    sure = {} if speeds & chosen.keys() else _commanded(header, speeds)
    if [spelled(_plain(header[k], "t")[1]) for k in there.get("t", ())] == ["s", "ns"]:
        there["t"], there["ns"] = ([k] for k in there["t"])
    commands = _way("command", sure or there)
    steers = "steer" in "".join(header[k].lower() for k in there.get("steering", ()))
    if commands == ("v", "omega") and steers and not (sure or speeds & chosen.keys()):
        commands = ("v", "steering")  # a turn rate beside it was measured
    if commands == ("v", "omega") and "lateral" in (sure or there):
        commands = ("v", "lateral", "omega")
    wanted = ("t", *_way("position", there), *_way("heading", there)) if poses else ("t", *commands)
    every = tuple(dict.fromkeys((*wanted, *commands, *{"ns"}.intersection(there))))
    missing = [name for name in wanted if name not in there]
    there |= {n: [k] for n, k in sure.items()}
    doubled = [name for name in every if len(there.get(name, ())) > 1]
    if missing or doubled:
        told = [f"{', '.join(missing)} missing"] if missing else []
        for name in doubled:
            names = [header[k] for k in there[name]]
            same, may_be = len(set(names)) == 1, " or ".join(map(short, names[:3]))
            told.append(f"{name} doubled" if same else f"{name} may be {may_be}")
        raise DataError(
            f"{file}: {where}: {' and '.join(told)}; expected {','.join(COLUMNS)}, got "
            f"{listed(header) or 'nothing'}; --columns "
            f"{' '.join(f'{name}=NAME' for name in dict.fromkeys((*missing, *doubled)))} tells"
        )
    kept = {n: there[n][0] for n in every if n in there}
    units = {n: _unit(file, n, header[k]) for n, k in kept.items() if n not in given}
    return Found(
        kept,
        {n: header[k] for n, k in kept.items()},
        {n: unit for n, unit in units.items() if unit},
        commands if set(commands) <= kept.keys() else (),
        tuple(header),
    )


def _way(kind: str, there: Collection[str]) -> tuple[str, ...]:
    """Columns by which a table says a thing."""
    whole = (way for way in WAYS[kind] if all(name in there for name in way))
    return next(whole, WAYS[kind][0])


def _places(file: Path, header: Sequence[str], name: str, chosen: Mapping[str, str]) -> list[int]:
    """Columns that `name` may mean: by the surest rule that finds any."""
    if name in chosen:
        if places := [k for k, theirs in enumerate(header) if theirs == chosen[name]]:
            return places
        hint = did_you_mean(chosen[name], [short(h) for h in header])
        told = f"{file}: columns: {name}={short(chosen[name])}: no such column"
        raise DataError(told + (hint or f"; it has {listed(header)}"))
    if exact := [k for k, theirs in enumerate(header) if theirs == name]:
        return exact
    return _meant(name, list(enumerate(header)))


def _meant(name: str, columns: Sequence[tuple[int, str]]) -> list[int]:
    """Numbers of the columns that `name` may mean by what they are called."""
    whole, endings = NAMES[name]
    told = {k: _plain(theirs, name)[0] for k, theirs in columns}
    is_pose = any(name in way for kind in ("position", "heading") for way in WAYS[kind])
    # then without what tells a command; a goal is no pose
    bare = {k: "_".join(w for w in t.split("_") if w not in WANTED) for k, t in told.items()}
    for plain in (told, {} if is_pose else bare):
        for alias in (name, *whole):
            if places := [k for k, words in plain.items() if words == alias]:
                return places
        for ending in endings:
            if places := [k for k, words in plain.items() if f"_{words}".endswith(f"_{ending}")]:
                return places
    return [k for k, words in told.items() if OWNED.get(words) == name]


def _commanded(header: Sequence[str], names: Collection[str]) -> dict[str, int]:
    """Columns of a way to tell commands whose names all say that they are commands."""
    sure = [(k, h) for k, h in enumerate(header) if _is_commanded(h, COMMANDED)]
    found = {n: places[0] for n in names if len(places := _meant(n, sure)) == 1}
    way = next((way for way in WAYS["command"] if set(way) <= found.keys()), ())
    more = ("lateral",) if way == WAYS["command"][0] and "lateral" in found else ()
    return {n: found[n] for n in (*way, *more)}


def _is_commanded(name: str, words: Collection[str] = WANTED) -> bool:
    """Whether a column's name says that it holds a command."""
    return not set(words).isdisjoint(_plain(name)[0].split("_"))


def _plain(theirs: str, name: str = "") -> tuple[str, str]:
    """A column's name in lower case, words parted by underscores, and the unit in it, if any."""
    theirs = theirs[:LONGEST_NAME]
    found = BRACKETS.search(theirs)
    bare = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", BRACKETS.sub("", theirs)).lower()
    words = re.sub(r"[^0-9a-z]+", "_", bare).strip("_").split("_")
    if found is not None:
        return "_".join(words), found["unit"]
    for count in (2, 1):
        unit = "/".join(words[-count:])
        if len(words) > count and (spelled(unit) in KNOWN.get(name, ()) or unit in SUFFIXES):
            return "_".join(words[:-count]), unit
    return "_".join(words), ""


def _unit(file: Path, name: str, theirs: str) -> str | None:
    """Unit that a header tells of a column, where it is not SI."""
    told, sizes = _plain(theirs, name)[1], KNOWN.get(name)
    if sizes is None or told in ("", "-", "1"):
        return None
    if (unit := spelled(told)) not in sizes:
        raise DataError(
            f"{file}: unknown unit {short(told)!r} in column {short(theirs)!r}: expected "
            f"{', '.join(sizes)}; --units {name}=... says what it is"
        )
    return None if unit == next(iter(sizes)) else unit


def listed(header: Sequence[str]) -> str:
    """Names of a header, as far as they fit one line."""
    return short(",".join(header))


def short(text: str) -> str:
    """Make text fit for an error's one line, whatever it was read from."""
    printable = "".join(c if c.isprintable() else "?" for c in text[:61])
    return printable if len(printable) <= 60 else printable[:57] + "..."
