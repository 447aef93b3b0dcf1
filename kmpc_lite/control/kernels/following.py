"""Where on a timed path a robot is, and the reference that it follows from there."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kmpc_lite.types import STATES, Array

TURN_LENGTH = 0.3
"""One radian of heading counts as much as this distance when the robot's place on its path is
looked for [m]."""
LOCATE_BACK, LOCATE_AHEAD = 0.5, 1.5
"""How far back and ahead along its path the robot's place may move in one step [s]."""
GOAL_STRETCH = 0.5
"""For so long before the path reaches the goal's position, the reference ends there: it does not
begin the last turn yet [s]."""


class Timed(NamedTuple):
    """Poses along a path, at the times at which they can be reached."""

    poses: Array
    """(K, 3) from the turn at the start to the one at the goal, K > 1."""
    times: Array
    """(K,) from zero on, growing [s]; the last turn begins at the last but one."""
    cusps: Array
    """(n,) when the robot stops and drives on in the other gear [s]."""
    step: float
    """Time between poses among which the robot's place is looked for [s]."""
    braking: float
    """How long the robot brakes at the end of a leg [s]."""


def poses_at(path: Timed, times: Array) -> Array:
    """Poses (n, 3) at times (n,) [s]; the ends are held."""
    poses = np.empty((len(times), STATES))
    # as complex numbers, for both coordinates are interpolated in the time of one
    places = np.interp(times, path.times, path.poses[:, 0] + 1j * path.poses[:, 1])
    poses[:, :2] = places.view(float).reshape(-1, 2)
    poses[:, 2] = np.interp(times, path.times, path.poses[:, 2])
    return poses


def leg_end(path: Timed, begin: float) -> float:
    """When the gear changes next after a time [s]; infinite if it does not."""
    later = path.cusps[path.cusps > begin]
    return float(later[0]) if len(later) else math.inf


def locate(path: Timed, pose: Array, place: float, least: float) -> tuple[float, float]:
    """Find the robot's place: the time of the path's pose that is nearest.

    Parameters
    ----------
    path : Timed
        What is followed.
    pose : ndarray
        The robot's pose (3,).
    place : float
        Where it was found last [s]; only places near it are looked at.
    least : float
        Where it must have come to [s].

    Returns
    -------
    place, off : float
        The time on the path [s], and the distance from its pose there [m].
    """
    last, duration, step = max(place, least), float(path.times[-1]), path.step
    begin = int(max(place - LOCATE_BACK, least) / step)
    begin += len(path.cusps) > 0  # the pose before a change of gear is not on this leg
    end = int(min(last + LOCATE_AHEAD, leg_end(path, least)) / step) + 2
    times = np.minimum(step * np.arange(begin, max(end, begin + 1)), duration)
    # next to the heading at the last place: the robot has not turned by half a circle since
    before = poses_at(path, np.array([min(int(last / step) * step, duration)]))[0, 2]
    heading = pose[2] - math.tau * np.rint((pose[2] - before) / math.tau)
    error = poses_at(path, times) - (pose[0], pose[1], heading)
    error[:, 2] *= TURN_LENGTH
    nearest = int(np.einsum("ni,ni->n", error, error).argmin())
    return float(times[nearest]), math.hypot(error[nearest, 0], error[nearest, 1])


def times_after(path: Timed, place: float, leg: float, later: Array) -> Array:
    """Times on the path of a robot that drives on from a place [s], braking where a leg ends.

    On its times alone a path ends at full speed: one that brakes before it has braked too late.

    Parameters
    ----------
    path : Timed
        What is followed.
    place : float
        Where the robot is [s], before the last turn.
    leg : float
        When its gear has changed last [s].
    later : ndarray
        How much later, (n,) [s].
    """
    end, braking = min(leg_end(path, leg), float(path.times[-2])), path.braking
    left = end - place
    if left <= 0.0 or braking == 0.0:
        return place + later
    # with a constant deceleration the root of the time that is left shrinks evenly
    root, rate = math.sqrt(min(left, 0.5 * braking)), 1.0 / math.sqrt(2.0 * braking)
    slowed = later - max(left - 0.5 * braking, 0.0)
    braked = end - np.maximum(root - rate * slowed, 0.0) ** 2
    times: Array = np.where(slowed <= 0.0, place + later, braked)
    return times + np.maximum(slowed - root / rate, 0.0)


def along_path(
    path: Timed, later: Array, place: float, leg: float, heading: float, turning: bool
) -> Array:
    """Poses (n, 3) of a robot that drives on along its path, their headings near its own.

    Parameters
    ----------
    path : Timed
        What is followed.
    later : ndarray
        How much later, (n,) [s].
    place : float
        Where the robot is [s].
    leg : float
        When its gear has changed last [s].
    heading : float
        Its own [rad].
    turning : bool
        Whether it is on its last turn.
    """
    drive_end = path.times[-2]
    times = place + later if turning else times_after(path, place, leg, later)
    if not turning and place > drive_end - GOAL_STRETCH:
        times = np.minimum(times, drive_end)
    states = poses_at(path, np.minimum(times, leg_end(path, leg)))
    here = poses_at(path, np.array([place]))[0, 2]
    states[:, 2] += math.tau * np.rint((heading - here) / math.tau)
    return states
