"""A turn of the lidar, undone of the robot's motion and brought to where the controller plans."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmware_bridge.messages import State
from firmware_bridge.sensors.lidar.options import LidarOptions

KEPT = 256  # number of poses that are remembered: two seconds of a fast source
AHEAD = 0.3  # a pose is carried on with its own speeds for so long at the most [s]


class Trail:
    """Remembers poses and tells those between and shortly behind them.

    One thread adds while others ask.
    """

    def __init__(self) -> None:
        self._states: deque[State] = deque(maxlen=KEPT)

    def add(self, state: State | None) -> None:
        """Remember a pose, if it is finite and newer than the last."""
        if state is None or not all(map(math.isfinite, (state.x, state.y, state.theta))):
            return
        if not self._states or state.stamp > self._states[-1].stamp:
            self._states.append(state)

    def poses(self, stamps: Array) -> Array | None:
        """Poses x, y [m], theta [rad] at times (N,) [s], (N, 3); None if none is remembered.

        Between poses they are interpolated. After the last they go on with its speeds, straight
        and turning evenly, for `AHEAD` at the most; before the first they are the first.
        """
        states = tuple(self._states)
        if not states:
            return None
        times = np.array([s.stamp for s in states])
        path = np.array([(s.x, s.y, s.theta) for s in states])
        path[:, 2] = np.unwrap(path[:, 2])
        found = np.column_stack([np.interp(stamps, times, column) for column in path.T])
        last = states[-1]
        later = np.clip(stamps - last.stamp, 0.0, AHEAD)
        if np.isfinite((last.v, last.omega)).all():
            heading = last.theta + 0.5 * later * last.omega
            found[:, 0] += later * last.v * np.cos(heading)
            found[:, 1] += later * last.v * np.sin(heading)
            found[:, 2] += later * last.omega
        return found


Pose = tuple[float, float, float]


class Sight:
    """Gives the newest scan, as seen from a pose.

    The robot moves while the sensor turns: each beam is first taken from where the sensor was at
    the beam's own time to where it was at the end of the turn. A beam that says something moves
    with its end point, one that does not turns with the robot. What then remains is where the
    sensor was at that moment, seen from the pose for which the controller plans: the mount of the
    scan.

    `options`: where it is mounted, and what counts. `sweep`: newest turn of the sensor.
    """

    def __init__(self, options: LidarOptions, sweep: Callable[[], Sweep | None]) -> None:
        self.options, self._sweep, self.trail = options, sweep, Trail()

    def on_tick(
        self, now: float, state: State | None, output: object, sent: bool, fresh: bool
    ) -> None:
        """Remember where the robot is (an observer of the control loop)."""
        self.trail.add(state)

    def look(self, state: State) -> Scan | None:
        """Give the newest scan as seen from a pose, which may lie ahead; None without one."""
        sweep = self._sweep()
        if sweep is None:
            return None
        poses = self.trail.poses(np.append(sweep.stamps, sweep.stamp))
        if poses is None:
            return None
        return make_scan(self.options, sweep, poses, state)


def make_scan(options: LidarOptions, sweep: Sweep, poses: Array, state: State) -> Scan:
    """Make a scan of a turn.

    `options`: of the lidar. `sweep`: n beams. `poses`: where the robot was at each beam and at the
    end, (N + 1, 3) [m, m, rad]. `state`: from where it is wanted.
    """
    low, high = limits(options, sweep)
    angles = -sweep.angles if options.mirrored else sweep.angles
    ranges = cleaned(options, sweep.ranges, low, high)
    ranges[ignored(options.ignore, angles + options.mount[2])] = np.nan
    places = compose(poses, options.mount)
    here = places[-1]
    angles, ranges = from_one_place(angles, ranges, places)
    ranges = np.where(ranges > high, np.inf, ranges)  # the sensor has moved
    binned, increment = into_bins(angles, ranges, options.beams)
    mount = seen_from(here, (state.x, state.y, state.theta))
    return Scan(binned, -math.pi, increment, low, high, mount, sweep.stamp, options.noise)


def limits(options: LidarOptions, sweep: Sweep) -> tuple[float, float]:
    """Nearest and farthest distance that counts [m]."""
    low = sweep.range_min if options.range_min is None else options.range_min
    high = sweep.range_max if options.range_max is None else options.range_max
    return low, high


def cleaned(options: LidarOptions, ranges: Array, low: float, high: float) -> Array:
    """Distances (N,) [m] as they count: unknown below the limits, infinite beyond them."""
    nothing = np.inf if options.no_return == "free" else np.nan
    found = np.where(np.isnan(ranges), nothing, ranges)
    found = np.where(found < low, np.nan, found)
    return np.where(found > high, np.inf, found)


def ignored(sectors: tuple[tuple[float, float], ...], directions: Array) -> np.ndarray:
    """Which directions (N,) [rad] lie in a sector from, to, counter-clockwise."""
    found = np.zeros(len(directions), dtype=bool)
    for begin, end in sectors:
        found |= np.mod(directions - begin, math.tau) <= np.mod(end - begin, math.tau)
    return found


def compose(poses: Array, mount: Pose) -> Array:
    """Where the sensor is, with the robot at poses (N, 3)."""
    x, y, turn = mount
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    return np.column_stack(
        [poses[:, 0] + cos * x - sin * y, poses[:, 1] + sin * x + cos * y, poses[:, 2] + turn]
    )


def seen_from(place: Array, pose: Pose) -> Pose:
    """A place (3,) as seen from a pose."""
    dx, dy = float(place[0]) - pose[0], float(place[1]) - pose[1]
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    turn = math.remainder(float(place[2]) - pose[2], math.tau)
    return cos * dx + sin * dy, cos * dy - sin * dx, turn


def from_one_place(angles: Array, ranges: Array, places: Array) -> tuple[Array, Array]:
    """Beams measured from places (N + 1, 3), as measured from the last of them."""
    here = places[-1]
    directions = angles + places[:-1, 2]
    hit = np.isfinite(ranges)
    reach = np.where(hit, ranges, 0.0)
    dx = places[:-1, 0] + reach * np.cos(directions) - here[0]
    dy = places[:-1, 1] + reach * np.sin(directions) - here[1]
    found = np.where(hit, np.arctan2(dy, dx), directions) - here[2]
    return found, np.where(hit, np.hypot(dx, dy), ranges)


def into_bins(angles: Array, ranges: Array, beams: int) -> tuple[Array, float]:
    """Sort beams into equal parts of a turn, from -pi on; gives ranges (beams,) and the part [rad].

    Each part takes its nearest return; without one it is unknown if a beam in it was, else free.
    A part without any beam takes the nearer of its neighbours, as long as beams lie no closer than
    that.
    """
    part = math.tau / beams
    index = np.round((angles + math.pi) / part).astype(np.intp) % beams
    order = np.where(np.isnan(ranges), np.inf, ranges)
    nearest = np.full(beams, np.inf)
    np.minimum.at(nearest, index, order)
    seen, unknown = np.zeros(beams, dtype=bool), np.zeros(beams, dtype=bool)
    seen[index] = True
    unknown[index[np.isnan(ranges)]] = True
    nearest[(unknown & np.isinf(nearest)) | ~seen] = np.nan
    reach = math.ceil(1.5 * beams / max(len(angles), 1))
    for _ in range(min(reach, 3)):
        before, after = np.roll(nearest, 1), np.roll(nearest, -1)
        given = np.roll(seen, 1) | np.roll(seen, -1)
        fill = ~seen & given
        nearest[fill] = np.fmin(before, after)[fill]
        seen |= fill
    return nearest, part


Array = NDArray[np.floating[Any]]


@dataclass(frozen=True, eq=False)
class Sweep:
    """One turn of a sensor as it was measured: each beam from where the sensor was at its time."""

    angles: Array
    """Directions of the beams in the order in which they were measured, counter-clockwise from the
    sensor's front (N,) [rad]."""
    ranges: Array  # distances (N,) [m]; inf: nothing within reach; NaN: nothing is known
    stamps: Array  # `time.monotonic()` of each beam (N,) [s]
    range_min: float  # [m]
    range_max: float  # [m]

    @property
    def stamp(self) -> float:
        """When its newest beam was measured [s]."""
        return float(self.stamps.max())

    @property
    def returns(self) -> float:
        """Share of the beams that say something, 0 to 1."""
        return float((~np.isnan(self.ranges)).mean())


@dataclass(frozen=True, eq=False)
class Scan:
    """One turn as if it were measured at once, its beams equally far apart."""

    ranges: Array  # distances (N,) [m]; inf: nothing within reach; NaN: nothing is known
    angle_min: float  # direction of the first beam, counter-clockwise from the sensor's front [rad]
    angle_increment: float  # between two beams [rad]
    range_min: float  # [m]
    range_max: float  # [m]
    mount: tuple[float, float, float]
    """Pose of the sensor when it measured, as seen from the pose for which the scan was asked for
    [m, m, rad]."""
    stamp: float  # when its newest beam was measured [s]
    noise: float = 0.01  # standard deviation of a distance [m]

    @property
    def angles(self) -> Array:
        """Directions of the beams (N,) [rad]."""
        return self.angle_min + self.angle_increment * np.arange(len(self.ranges))


TRAVEL, TURN = 0.1, 0.1
"""A robot that has come so far [m], or turned so far [rad], sees something else."""
DISTINCT = 12
"""Turns of fewer different distances may well be the same again: a few coarse sectors, a field."""


class FrozenScan:
    """Compares each turn with the first that was like it, and where the robot was then."""

    def __init__(self) -> None:
        self._first: Sweep | None = None
        self._there: State | None = None

    def repeats(self, sweep: Sweep, state: State | None) -> bool:
        """Whether a new turn is the same, to the last digit, as one seen from elsewhere."""
        first, there = self._first, self._there
        if first is None or not _same(first, sweep):
            self._first, self._there = sweep, state
            return False
        if there is None or state is None:
            self._there = state
            return False
        turned = abs(math.remainder(state.theta - there.theta, math.tau))
        moved = math.hypot(state.x - there.x, state.y - there.y)
        return moved > TRAVEL or turned > TURN


def _same(first: Sweep, second: Sweep) -> bool:
    if not np.array_equal(first.ranges, second.ranges, equal_nan=True):
        return False
    return len(np.unique(second.ranges[np.isfinite(second.ranges)])) >= DISTINCT
