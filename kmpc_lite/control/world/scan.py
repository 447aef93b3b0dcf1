"""What a laser scanner saw from the robot, beam by beam."""

from __future__ import annotations

import math
from collections.abc import Iterable
from copy import copy
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmpc_lite.control.footprint import FARTHEST
from kmpc_lite.control.input_checks import POSITION_LIMIT
from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.library import Singles
from kmpc_lite.control.options import USUAL_OBSTACLES, ObstacleOptions
from kmpc_lite.errors import ProblemError
from kmpc_lite.files import real_array
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

Sector = tuple[float, float]  # from one direction counter-clockwise to another [rad]
Layout = tuple[int, float, float, float, bool]
"""Number of beams, direction of the first and from beam to beam, heading of the mount [rad], and
whether they count clockwise."""


@dataclass(frozen=True, eq=False)
class LaserScan:
    """One scan, like ``sensor_msgs/LaserScan``: seen from the pose of the step that it is given to.

    A range between `range_min` and `range_max` is a hit. Infinity, and a range of exactly
    `range_max`, mean that nothing is within `range_max`. NaN, 0, -1, minus infinity, and all other
    ranges outside the limits tell nothing: what lies along such a beam stays unknown.

    Parameters
    ----------
    ranges : array_like
        (B,) [m].
    angle_min : float
        Direction of the first beam, in the scanner's frame [rad].
    angle_increment : float
        From beam to beam [rad]; negative for a scanner that turns clockwise.
    range_max : float
        How far the scanner sees [m].
    range_min : float
        Ranges below tell nothing [m].
    mount : array_like
        x, y [m] and heading [rad] of the scanner in the robot's frame: x ahead, y to the left.
    mirrored : bool
        Whether the scanner is mounted upside down, so that its angles count clockwise as seen from
        above.
    noise : float
        Standard deviation of a range [m].
    age : float
        How much older than the pose the last beam is [s].
    time_increment : float
        From beam to beam [s]; zero if all beams count as of one moment.
    self_radius : float
        Hits nearer than this to the robot's centre are the robot itself [m]: its mast, its arm.
        What lies behind them is unknown. The controller counts hits within the robot's radius as
        such in any case.
    ignore : sequence of tuple
        Directions that tell nothing, each from one counter-clockwise to another, as seen from the
        scanner in the robot's frame (0 is ahead) [rad].
    limits : ObstacleOptions
        How many beams it may have.

    Raises
    ------
    ProblemError
        Names the field that is wrong. The values of `ranges` are not looked at: what arrives while
        driving must not raise.

    Examples
    --------
    >>> scan = LaserScan([1.0, np.inf, np.nan], angle_min=0.0, angle_increment=1.0, range_max=4.0)
    >>> scan.points.tolist()
    [[1.0, 0.0]]
    >>> scan.reach.tolist()
    [1.0, 4.0, 0.0]
    """

    ranges: Array
    angle_min: float
    angle_increment: float
    range_max: float
    range_min: float = 0.0
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    mirrored: bool = False
    noise: float = 0.01
    age: float = 0.0
    time_increment: float = 0.0
    self_radius: float = 0.0
    ignore: tuple[Sector, ...] = ()

    def __init__(
        self,
        ranges: ArrayLike,
        angle_min: float,
        angle_increment: float,
        range_max: float,
        range_min: float = 0.0,
        mount: ArrayLike = (0.0, 0.0, 0.0),
        mirrored: bool = False,
        noise: float = 0.01,
        age: float = 0.0,
        time_increment: float = 0.0,
        self_radius: float = 0.0,
        ignore: Iterable[Sector] = (),
        limits: ObstacleOptions = USUAL_OBSTACLES,
    ) -> None:
        values = np.array(real_array(ranges, "scan: ranges", ProblemError))
        if values.ndim != 1 or not 1 <= len(values) <= limits.scan_beams:
            raise ProblemError(
                f"scan: expected ranges (B,), B from 1 to {limits.scan_beams:,}, "
                f"got shape {values.shape}"
            )
        values.flags.writeable = False
        fields: dict[str, Any] = {
            "ranges": values,
            "angle_min": _number("angle_min", angle_min, -np.inf),
            "angle_increment": _number("angle_increment", angle_increment, -np.inf),
            "range_max": _number("range_max", range_max, 0.0, POSITION_LIMIT),
            "range_min": _number("range_min", range_min, 0.0, POSITION_LIMIT),
            "mirrored": bool(mirrored),
            "noise": _number("noise", noise, 0.0, POSITION_LIMIT),
            "age": _number("age", age, 0.0),
            "time_increment": _number("time_increment", time_increment, 0.0),
            "self_radius": _number("self_radius", self_radius, 0.0, POSITION_LIMIT),
        }
        if not fields["range_min"] < fields["range_max"]:
            raise ProblemError(
                f"scan: expected range_min below range_max, got {fields['range_min']:g} m and "
                f"{fields['range_max']:g} m"
            )
        place = real_array(mount, "scan: mount", ProblemError)
        if place.shape not in ((2,), (3,)) or not (np.abs(place) <= POSITION_LIMIT).all():
            raise ProblemError(
                f"scan: expected a mount x, y, yaw of finite numbers, none beyond "
                f"{POSITION_LIMIT:g}, got {place.tolist()}"
            )
        x, y, *heading = place.tolist()
        fields["mount"] = x, y, heading[0] if heading else 0.0
        sectors = real_array(list(ignore), "scan: ignore", ProblemError).reshape(-1, 2)
        if not np.isfinite(sectors).all():
            raise ProblemError(f"scan: ignore: expected finite angles, got {sectors.tolist()}")
        fields["ignore"] = tuple((float(a), float(b)) for a, b in sectors)
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.ranges)

    @cached_property
    def directions(self) -> Array:
        """Directions (B,) of the beams in the robot's frame [rad]."""
        return beams(*self.layout)[0]

    @property
    def layout(self) -> Layout:
        """What the directions of the beams follow from: scans of one scanner have the same."""
        count, heading = len(self.ranges), self.mount[2]
        return count, self.angle_min, self.angle_increment, heading, self.mirrored

    @cached_property
    def ages(self) -> Array:
        """How much older than the pose each beam is, (B,) [s]."""
        found: Array = self.age + self.time_increment * np.arange(len(self.ranges) - 1, -1, -1)
        return found

    @property
    def hits(self) -> NDArray[np.bool_]:
        """Which beams hit something that is not the robot, (B,)."""
        return self._told[0]

    @property
    def clear(self) -> NDArray[np.bool_]:
        """Which beams saw nothing within `range_max`, (B,)."""
        return self._told[1]

    @property
    def unknown(self) -> NDArray[np.bool_]:
        """Which beams tell nothing, (B,)."""
        return ~(self.hits | self.clear)

    @property
    def reach(self) -> Array:
        """How far each beam saw nothing, (B,) [m]: zero if it tells nothing."""
        return self._told[2]

    @property
    def ends(self) -> Array:
        """Where the beams end in the robot's frame, (B, 2) [m]; the scanner, where unknown."""
        return self._told[3]

    @property
    def points(self) -> Array:
        """End points of the hits in the robot's frame, (M, 2) [m]."""
        return self.ends[self.hits]

    @cached_property
    def _told(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Array, Array]:
        return self._tell()

    def _tell(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_], Array, Array]:
        """What each beam tells, as of `kernels.scan_beams.told_beams`."""
        return library.told_beams(
            self.ranges,
            beams(*self.layout)[1],
            counted(self.layout, self.ignore),
            np.array(self.mount[:2]),
            self.range_min,
            self.range_max,
            self.self_radius,
        )

    def scaled(self, length: float, time: float) -> LaserScan:
        """Return the same in units of a length [m] and a time [s]."""
        if length == 1.0 and time == 1.0:
            return self
        other = self._copy()
        for name in ("ranges", "range_max", "range_min", "noise", "self_radius"):
            object.__setattr__(other, name, getattr(self, name) / length)
        for name in ("age", "time_increment"):
            object.__setattr__(other, name, getattr(self, name) / time)
        x, y, heading = self.mount
        object.__setattr__(other, "mount", (x / length, y / length, heading))
        return other

    def with_self_radius(self, radius: float) -> LaserScan:
        """Return the scan with a `self_radius` [m] of at least this."""
        if radius <= self.self_radius:
            return self
        other = self._copy()
        object.__setattr__(other, "self_radius", float(radius))
        other.__dict__["_told"] = other._tell()
        return other

    def _copy(self) -> LaserScan:
        """Return the same, of which nothing is known beyond what was given."""
        other = copy(self)
        for name in ("_told", "ages", "directions"):
            other.__dict__.pop(name, None)
        return other


@lru_cache(maxsize=16)
def beams(
    count: int, first: float, increment: float, heading: float, mirrored: bool
) -> tuple[Array, Array]:
    """Directions (B,) of a scanner's beams in the robot's frame [rad], and unit vectors (B, 2)."""
    own = first + increment * np.arange(count)
    directions = heading + (-own if mirrored else own)
    along = np.stack([np.cos(directions), np.sin(directions)], axis=1)
    for array in (directions, along):
        array.flags.writeable = False
    return directions, along


@lru_cache(maxsize=16)
def counted(layout: Layout, ignore: tuple[Sector, ...]) -> NDArray[np.bool_]:
    """Which of a scanner's beams (B,) lie in no sector that tells nothing."""
    directions = beams(*layout)[0]
    found = np.ones(len(directions), dtype=bool)
    for begin, end in ignore:
        found &= np.mod(directions - begin, 2.0 * np.pi) > np.mod(end - begin, 2.0 * np.pi)
    return found


def _number(name: str, value: Any, least: float, most: float = FARTHEST) -> float:
    """Finite number of at least a least one, in size at most the most."""
    is_number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    number = float(value) if is_number else np.nan
    if not (least <= number and abs(number) <= most):
        bound = "" if least == -np.inf else f" >= {least:g}"
        bound += "" if most == FARTHEST else f", at most {most:g}"
        raise ProblemError(f"scan: {name}: expected a finite number{bound}, got {value!r:.80}")
    return number


BEYOND = 1e-6
"""How far beyond its end a sector is looked at, to tell whether another one goes on there [rad]."""
EQUAL = 1e-9  # difference of two angles that is rounding [rad]
DIRECTIONS = 2048
"""Directions that are told apart all around: the beams of the finest scanner that is usual."""
NOTHING = 1e-15  # keeps a quotient finite: what it is added to changes by less than rounding


def numbers_of(x: Singles, y: Singles) -> NDArray[np.intp]:
    """Number directions (x, y) from 0, straight back, counter-clockwise.

    Without an arc tangent: by the sum of both sides of a triangle. Straight back has the number
    DIRECTIONS, too.
    """
    size: Singles = np.abs(x)
    size += np.abs(y)
    size += NOTHING
    turn = np.divide(x, size, out=size)
    turn *= -0.25 * DIRECTIONS
    turn += 0.25 * DIRECTIONS
    np.copysign(turn, y, out=turn)
    turn += 0.5 * DIRECTIONS
    return turn.astype(np.intp)


def outlook_of(scan: LaserScan) -> tuple[float, float, float, float] | None:
    """Where the scanner of a scan looks, in the robot's frame; none if no beam counts.

    Its x and y, the direction of the middle of what it sees, and how far to either side it sees
    [rad]; pi: all around.
    """
    sector = _sector(scan.layout, scan.ignore)
    if sector is None:
        return None
    return *scan.mount[:2], *sector


@lru_cache(maxsize=16)
def _sector(layout: Layout, ignore: tuple[Sector, ...]) -> Sector | None:
    """Middle and half of all directions but the widest gap between beams [rad]."""
    directions = beams(*layout)[0]
    for begin, end in ignore:
        directions = directions[
            np.mod(directions - begin, math.tau) > np.mod(end - begin, math.tau)
        ]
    if not len(directions):
        return None
    known = np.sort(wrap(directions))
    gaps = np.diff(known, append=known[0] + math.tau)
    widest = int(gaps.argmax())
    gap = float(gaps[widest])
    if gap <= 2.0 * abs(layout[2]):
        return 0.0, math.pi
    return float(wrap(known[widest] + 0.5 * gap + math.pi)), math.pi - 0.5 * gap


class Outlooks:
    """Where all scanners of a robot look.

    `rows`: (S, 4) of each scanner, as of `outlook_of`.
    """

    def __init__(self, rows: Array) -> None:
        self._rows = rows
        ends = self._rows[:, 2] + self._rows[:, 3] + BEYOND
        halves = self._rows[:, 3]
        some = len(halves) > 0 and float(halves.max()) < math.pi
        self.is_narrow = some and bool((self.beyond(ends) > 0.0).any())
        """Whether there are directions in which none looks; not if there is none at all."""

    def beyond(self, directions: Array) -> Array:
        """How far directions (n,) in the robot's frame lie beyond what is seen, (n,) [rad]."""
        off = np.abs(wrap(directions[:, None] - self._rows[:, 2])) - self._rows[:, 3]
        found: Array = np.maximum(off, 0.0).min(axis=1)
        return found

    def turns(self, pose: Array, points: Array, slack: float) -> Array:
        """Turns [rad] of a robot at a pose (3,) that bring points (n, 2) before a scanner, (m,).

        Of the points that none looks at, or only with the outermost `slack` [rad] of what it sees:
        all the way until one faces them.
        """
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        x, y = points[:, 0, None] - pose[0], points[:, 1, None] - pose[1]
        rows = self._rows
        ahead, aside = cos * x + sin * y - rows[:, 0], cos * y - sin * x - rows[:, 1]
        off = wrap(np.arctan2(aside, ahead) - rows[:, 2])
        beyond = np.abs(off) - np.maximum(rows[:, 3] - slack, 0.5 * rows[:, 3])
        nearest = beyond.argmin(axis=1)
        each = np.arange(len(points))
        found: Array = off[each, nearest][beyond[each, nearest] > 0.0]
        return found


class Rays:
    """A scan in the world: where its hits lie, and what its beams passed through.

    `scan`: seen from the robot. `poses`: where the robot was when it was taken: (3,), or (B, 3)
    where beams are of different ages. `cell`: side of the cells that are looked at.
    """

    def __init__(self, scan: LaserScan, poses: Array, cell: float) -> None:
        one = poses.ndim == 1
        cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
        mount_x, mount_y, _ = scan.mount

        def placed(x: Array | float, y: Array | float) -> tuple[Array, Array]:
            return poses[..., 0] + cos * x - sin * y, poses[..., 1] + sin * x + cos * y

        reach, hits, step = scan.reach, scan.hits, abs(scan.angle_increment)
        x, y = placed(scan.ends[:, 0], scan.ends[:, 1])
        ranges, deviations = library.averaged_ranges(reach, hits, step, scan.noise, 0.5 * cell)
        along = beams(*scan.layout)[1].T
        surface = placed(ranges * along[0] + mount_x, ranges * along[1] + mount_y)
        self.hits = np.stack(surface, axis=1)[hits]  # (M, 2) what was hit
        self.deviations = deviations[hits]
        """(M,) standard deviations of their distances from the scanner."""
        self.origin = np.array(placed(mount_x, mount_y)).reshape(2, -1)[:, -1]
        """(2,) the scanner; at the time of the last beam."""
        self.low = np.minimum((x.min(), y.min()), self.origin) - cell
        """(2,) corner of the area that no beam has left ..."""
        self.high = np.maximum((x.max(), y.max()), self.origin) + cell  # ... and the opposite one.
        if one:
            # beams of one moment lie in the robot's frame as those of the scan before
            self.turn = float(cos), float(sin)
            nearest, aside = _nearest_beams_of(scan.layout)
        else:
            self.turn = 1.0, 0.0
            x, y = x - self.origin[0], y - self.origin[1]
            reach = np.where(scan.unknown, 0.0, np.hypot(x, y))
            # if nothing is known of a beam's end, something is of its direction
            directions = np.where(scan.unknown, poses[:, 2] + scan.directions, np.arctan2(y, x))
            nearest, aside = _nearest_beams(directions)
        failed = np.isnan(scan.ranges) & counted(scan.layout, scan.ignore)
        # beams that fail by chance fail alone
        some = (failed[1:-1] & failed[:-2] & failed[2:]).any()
        self.vain = failed.take(nearest) if some else None
        """(2048,) numbered directions in which beams measure nothing, near or far; None: no three
        neighbours fail."""
        self.farthest = float(reach.max())  # longest ray
        # only so far does the nearest beam pass through a cell in a direction beside it
        within = np.minimum(reach.take(nearest), 0.5 * cell / np.maximum(aside, NOTHING))
        self.squares = np.empty(DIRECTIONS + 1, dtype=np.float32)
        """(2049,) square of how far rays passed in each direction, numbered by `kernels.scan_map`
        in a frame whose heading has the cosine and sine `turn`."""
        self.squares[:-1] = within * within
        self.squares[-1] = self.squares[0]


def _middles() -> Array:
    """Angles (DIRECTIONS,) of the middles of the numbered directions [rad], from -pi upwards."""
    share = (np.arange(DIRECTIONS) + 0.5) * (4.0 / DIRECTIONS) - 2.0
    along = 1.0 - np.abs(share)
    found: Array = np.arctan2(np.copysign(1.0 - np.abs(along), share), along)
    return found


MIDDLES = _middles()


def _nearest_beams(directions: Array) -> tuple[NDArray[np.intp], Array]:
    """For each numbered direction the nearest of beams (B,), and how far aside that one points."""
    directions = wrap(directions)
    order = np.argsort(directions)
    known = directions[order]
    after = np.searchsorted(known, MIDDLES)
    first, second = (after - 1) % len(known), after % len(known)
    aside = [np.abs(wrap(known[i] - MIDDLES)) for i in (first, second)]
    # what lies in the middle of two beams, but for rounding, goes to the first
    nearer = aside[0] <= aside[1] + EQUAL
    nearest: NDArray[np.intp] = order[np.where(nearer, first, second)]
    return nearest, np.where(nearer, *aside)


@lru_cache(maxsize=16)
def _nearest_beams_of(layout: Layout) -> tuple[NDArray[np.intp], Array]:
    """The same of a scanner whose beams are of one moment, in the robot's frame."""
    return _nearest_beams(beams(*layout)[0])
