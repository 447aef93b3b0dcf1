"""Which column of a table is what: our names, the user's, and those that other tools give."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from kmpc_lite.errors import DataError, did_you_mean
from kmpc_lite.learn.logs import KNOWN

COLUMNS = ("t", "x", "y", "theta", "v", "omega")
UNITS = ("s", "m", "m", "rad", "m/s", "rad/s")
QUATERNION = ("qx", "qy", "qz", "qw")
COMMANDS = ("v", "omega")
NAMES: dict[str, tuple[str, ...]] = {
    "t": ("time", "stamp", "timestamp", "secs", "sec", "seconds", "time_stamp", "ts", "elapsed"),
    "x": ("px", "tx", "pos_x", "x_pos", "east", "easting"),
    "y": ("py", "ty", "pos_y", "y_pos", "north", "northing"),
    "theta": ("yaw", "heading", "psi", "th", "phi", "angle", "orientation", "azimuth"),
    "v": ("cmd_v", "v_cmd", "u_v", "v_ref", "cmd_vel", "linear", "speed", "velocity", "vel", "vx"),
    "omega": ("cmd_omega", "omega_cmd", "cmd_w", "w_cmd", "w", "wz", "angular", "yaw_rate")
    + ("yawrate", "turn_rate", "cmd_yaw_rate", "omega_ref", "u_omega", "u_w"),
    "qx": ("q_x", "rot_x"),
    "qy": ("q_y", "rot_y"),
    "qz": ("q_z", "rot_z"),
    "qw": ("q_w", "rot_w"),
}
"""Whole names, in lower case, with underscores between their words."""
ENDINGS: dict[str, tuple[str, ...]] = {
    "t": ("header_stamp", "timestamp", "time"),
    "x": ("position_x", "pos_x", "translation_x", "pose_x", "r_x"),
    "y": ("position_y", "pos_y", "translation_y", "pose_y", "r_y"),
    "theta": ("theta", "yaw", "heading"),
    "v": ("linear_x", "lin_vel", "linear_velocity", "lin_x", "v"),
    "omega": ("angular_z", "ang_vel", "angular_velocity", "ang_z", "omega", "yaw_rate"),
    **{f"q{a}": (f"orientation_{a}", f"rotation_{a}", f"q_rs_{a}", f"quat_{a}") for a in "xyzw"},
}
"""Last words of longer names: ``pose.pose.position.x``."""
WORDS = {"°": "deg", "degrees": "deg", "degree": "deg", "°/s": "deg/s", "degrees/s": "deg/s"}
"""Units as headers spell them too."""
COMMANDED = ("cmd", "command", "target", "setpoint", "desired", "ref")
"""Words that tell a command from a measured speed."""
LONGEST_NAME = 100
"""Most characters of a column's name that are searched: the time that a search for brackets takes
grows with their square."""
BRACKETS = re.compile(r"\s*[\[(]\s*(?P<unit>[^\])]*?)\s*[\])]\s*$")
SUFFIX = re.compile(r"_(?P<unit>ns|us|ms|sec|deg|rad|mm|cm)$")


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
            lines.append(
                f"v={self.shown('v')} and omega={self.shown('omega')} are learned from; commands "
                f"may be in {others}, too (--columns v=... omega=...)"
            )
        return tuple(lines)


def find_columns(
    file: Path, header: Sequence[str], chosen: Mapping[str, str], where: str, poses: bool = True
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

    Raises
    ------
    DataError
        For columns that are missing, doubled, or of which several may be meant.
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
    wanted = _wanted(found, several, poses)
    missing = [name for name in wanted if name not in found and name not in several]
    doubled = [name for name in (*wanted, *COMMANDS) if name in several]
    if missing or doubled:
        _refuse(file, header, where, missing, {n: several[n] for n in doubled})
    kept = [n for n in (*wanted, *COMMANDS) if n in found]
    units = {n: u for n in kept if (u := _unit(n, header[found[n]]))}
    names = {n: header[found[n]] for n in kept}
    taken = set(names.values())
    others = tuple(h for h in header if h not in taken and _is_commanded(h))
    plain = all(n in names and n not in chosen and not _is_commanded(names[n]) for n in COMMANDS)
    passed_over = others if plain else ()
    return Found({n: found[n] for n in kept}, names, units, passed_over, tuple(header))


def _wanted(found: Mapping[str, int], several: Mapping[str, list[int]], poses: bool) -> list[str]:
    """Columns that must be there."""
    if not poses:
        return ["t", *COMMANDS]
    quaternion = "theta" not in found and "theta" not in several and "qz" in found
    turn = list(QUATERNION) if quaternion else ["theta"]
    return ["t", "x", "y", *turn]


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
    for alias in (name, *NAMES[name]):
        if places := [k for k, theirs in enumerate(plain) if theirs == alias]:
            return places
    for ending in ENDINGS[name]:
        if places := [k for k, theirs in enumerate(plain) if f"_{theirs}".endswith(f"_{ending}")]:
            sure = [k for k in places if any(word in plain[k] for word in COMMANDED)]
            return sure if len(sure) == 1 and name in COMMANDS else places
    return []


def _is_commanded(name: str) -> bool:
    """Whether a column's name says that it holds a command."""
    return any(word in name.lower() for word in COMMANDED)


def _plain(name: str) -> str:
    """A name without its unit, in lower case, words parted by underscores."""
    bare = BRACKETS.sub("", name[:LONGEST_NAME])
    words = re.sub(r"[^0-9a-z]+", "_", bare.lower()).strip("_")
    return SUFFIX.sub("", words)


def _unit(name: str, theirs: str) -> str | None:
    """Unit that a header tells of a column, where it is not SI."""
    theirs = theirs[:LONGEST_NAME]
    found = BRACKETS.search(theirs) or SUFFIX.search(theirs.lower().strip())
    unit = WORDS.get(found["unit"], found["unit"]) if found else ""
    sizes = KNOWN.get(name, {})
    return unit if sizes.get(unit, 1.0) != 1.0 else None


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
