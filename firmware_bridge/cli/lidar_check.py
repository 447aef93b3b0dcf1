"""What `kmpc check` says of a lidar: what it sees, whether that fits the map, what looks wrong."""

from __future__ import annotations

import math
import time
from typing import TYPE_CHECKING, Any

import numpy as np

from firmware_bridge.integration.course import own_frame, scenario_of
from firmware_bridge.messages import State
from firmware_bridge.robot_file import Robot
from firmware_bridge.runtime.timing import listen
from firmware_bridge.sensors.sensor_driver import placed

if TYPE_CHECKING:
    from firmware_bridge.sensors.sight import Scan
    from firmware_bridge.sensors.sighted import SightedDriver
    from kmpc_lite.scenario.world import World

DIRECTIONS = 720  # into which the map is looked at from the sensor
NEAR, SHARE = 0.1, 0.05  # a hit fits the map within so much [m], and so much of its distance
BETTER = 0.25  # share of hits that another mount must fit more, to be proposed
FEW = 20  # fewer hits tell nothing


def against_map(scan: Scan, state: State, robot: Robot) -> list[str]:
    """Lines on how a scan, seen from a pose in the vehicle's own frame, fits the robot's map.

    Raises ConfigError for a scenario that cannot be read.
    """
    from kmpc_lite.scenario.world import world_of

    assert robot.lidar is not None
    scenario = scenario_of(robot)
    here = placed(state, own_frame(robot, scenario))
    pose = here.x, here.y, here.theta
    return fit(scan, pose, world_of(scenario), robot.lidar.mirrored)


def fit(scan: Scan, pose: tuple[float, float, float], world: World, mirrored: bool) -> list[str]:
    """Lines on how a scan fits a world, seen from a pose x, y [m], theta [rad]."""
    hits = np.isfinite(scan.ranges)
    if hits.sum() < FEW:
        return []
    ahead, left, turn = scan.mount
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    place = np.array([pose[0] + cos * ahead - sin * left, pose[1] + sin * ahead + cos * left])
    step = math.tau / DIRECTIONS
    directions = step * np.arange(DIRECTIONS)
    there = world.ranges(place, directions)
    ranges, angles = scan.ranges[hits], scan.angles[hits]

    def fits(flipped: bool, other: Any) -> Any:
        """Share of hits (K,) that fit with the sensor turned by (K,) more [rad]."""
        own = -angles if flipped else angles
        index = np.round((pose[2] + turn + other[:, None] + own) / step).astype(int) % DIRECTIONS
        return (np.abs(there[index] - ranges) < NEAR + SHARE * ranges).mean(axis=1)

    turns = np.radians(np.arange(0, 360, 5))
    now = float(fits(False, np.zeros(1))[0])
    found = [f"lidar: {100.0 * now:.0f} % of its hits lie where the map has something"]
    shares = [fits(flipped, turns) for flipped in (False, True)]
    best = int(np.argmax(shares))
    flipped, most = best >= len(turns), float(np.max(shares))
    if most > now + BETTER:
        third = math.remainder(turn + float(turns[best % len(turns)]), math.tau)
        found.append(
            f"hint: {100.0 * most:.0f} % would with lidar.mirrored = "
            f"{str(mirrored != flipped).lower()} and {third:.2f} as lidar.mount's third number, "
            "if the robot stands where the pose says"
        )
    return found


SELF = 0.25  # hits nearer than this may be the robot itself [m]
DARK = 0.3  # a larger share of beams without a return is worth a word


def look(driver: SightedDriver, robot: Robot, seconds: float) -> list[tuple[bool, str]]:
    """Watch a lidar for some time [s]; gives lines, and whether each is good.

    `driver`: connected. `robot`: whose lidar it is. `seconds`: how long [s].
    """
    last, gaps, ages = listen(driver.sweep, seconds)
    health = driver.lidar.health()
    found = [(False, fault) for fault in driver.health().scan_faults]
    if last is None:
        return found or [(False, f"lidar: {health.name}: no scan within {seconds:g} s")]
    text = (
        f"lidar: {health.name}: {health.rate:.1f} turns/s, "
        f"{1e3 * ages.quantile(0.5):.0f} ms old when they come, "
        f"gaps up to {1e3 * gaps.maximum:.0f} ms"
    )
    found.append((gaps.count > 0 and gaps.maximum <= robot.gate.scan_age, text))
    state = driver.state() or State(0.0, 0.0, 0.0, 0.0, 0.0, time.monotonic())
    driver.sight.trail.add(state)
    scan = driver.sight.look(state)
    if scan is not None:
        found += [(True, line) for line in (seen(scan), *hints(scan, robot))]
        if robot.control.scenario is not None:
            found += [(True, line) for line in against_map(scan, state, robot)]
    found += [(True, f"note: {note}") for note in getattr(driver.lidar, "notes", tuple)()]
    return found


def seen(scan: Scan) -> str:
    """Nearest hit and its direction, and how many beams are unknown."""
    ranges = scan.ranges
    hits, unknown = np.isfinite(ranges), np.isnan(ranges)
    share = f"{100.0 * unknown.mean():.0f} % of {len(ranges)} beams are unknown"
    if not hits.any():
        return f"lidar: nothing within {scan.range_max:g} m; {share}"
    nearest = int(np.argmin(np.where(hits, ranges, np.inf)))
    where = direction(float(scan.angles[nearest]) + scan.mount[2])
    return f"lidar: nearest {ranges[nearest]:.2f} m from it, {where}; {share}"


def direction(angle: float) -> str:
    """Direction on the robot, in words, of an angle [rad].

    >>> direction(0.1), direction(math.pi / 2), direction(-3 * math.pi / 4)
    ('6 degrees left of ahead', '90 degrees left of ahead', '135 degrees right of ahead')
    """
    degrees = math.degrees(math.remainder(angle, math.tau))
    if abs(degrees) < 0.5:
        return "straight ahead"
    return f"{abs(degrees):.0f} degrees {'left' if degrees > 0 else 'right'} of ahead"


def hints(scan: Scan, robot: Robot) -> list[str]:
    """What a user should look at."""
    assert robot.lidar is not None
    found = [
        "hint: hold a hand to the robot's left: if the nearest hit is then on its right, "
        f"lidar.mirrored = {str(robot.lidar.mirrored).lower()} is wrong; if it is elsewhere, "
        "lidar.mount's third number is"
    ]
    if np.isnan(scan.ranges).mean() > DARK and robot.lidar.no_return == "unknown":
        found.append(
            "hint: beams that say nothing are unknown, and the robot does not drive into what it "
            'does not know; if it is open space: lidar.no_return = "free"'
        )
    near = np.where(np.isfinite(scan.ranges), scan.ranges, np.inf) < SELF
    for begin, end in runs(near):
        a, b = (
            math.remainder(float(scan.angles[i]) + scan.mount[2], math.tau) for i in (begin, end)
        )
        half = 0.5 * scan.angle_increment
        found.append(
            f"hint: something is nearer than {SELF:g} m {direction(a)} to {direction(b)}: "
            f"if it is the robot itself: lidar.ignore = [[{a - half:.2f}, {b + half:.2f}]]"
        )
    return found


def runs(marked: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of each run in a circle (N,) of marks.

    >>> runs(np.array([True, False, True, True, False, True]))
    [(2, 3), (5, 0)]
    """
    if marked.all() or not marked.any():
        return []
    begins = np.flatnonzero(marked & ~np.roll(marked, 1))
    ends = np.flatnonzero(marked & ~np.roll(marked, -1))
    if ends[0] < begins[0]:
        ends = np.roll(ends, -1)
    return [(int(a), int(b)) for a, b in zip(begins, ends, strict=True)]
