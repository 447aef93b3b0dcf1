"""What a path costs beside its time: narrowness, the unknown, changes, and time lost before."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.field.outline_clearance import outline_distances
from kmpc_lite.control.path.planner import PathRequest, Route
from kmpc_lite.control.path.taut_string import CUT_DEPTH, GeometricPath
from kmpc_lite.control.path.timed_path import poses_along
from kmpc_lite.geometry import angle_swept, wrap
from kmpc_lite.types import Array

BODY_SAMPLES = 400
"""Largest number of poses of a path at which it is looked first whether a robot that is not round
fits."""
HALVINGS = 4
"""How often it is looked between two poses that are too far apart to be sure."""


def narrowness(clearance: float, widest: float, options: GuidanceOptions) -> float:
    """How many times its time a path counts that keeps a clearance, of the widest one [m]."""
    return 1.0 + options.narrow_cost * (1.0 - clearance / widest)


def switching_time(path: GeometricPath, request: PathRequest, options: GuidanceOptions) -> float:
    """What it costs to leave the path that is driven for this one [s]."""
    if request.driven is None:
        return 0.0
    return max(options.switch_time, request.gear_time) + options.switch_share * path.time


def lost_time(
    path: GeometricPath, clearance: float, request: PathRequest, landmarks: Array
) -> float:
    """Time that was lost on paths like this one [s]."""
    return sum(
        route.lost
        for route in request.tried
        if abs(route.clearance - clearance) <= CUT_DEPTH and same_side(route, path, landmarks)
    )


def extra_time(path: GeometricPath, request: PathRequest, options: GuidanceOptions) -> float:
    """What a change of gear, turning back, and the unknown cost [s]."""
    extra = 0.0
    if request.driven is not None and request.driven.reverse != path.reverse:
        extra += request.gear_time
    heading = float(path.headings[0]) + (math.pi if path.reverse else 0.0)
    if request.turned * wrap(heading - float(request.start[2])) < 0.0:
        extra += abs(request.turned) / float(request.forward[1])
    if request.known is not None:
        unknown = request.known.unknown_length(path.points)
        extra += options.unknown_cost * unknown / float(request.forward[0])
    return extra


def look_times(request: PathRequest, points: Array, plan_time: float) -> tuple[float, float]:
    """How long the robot stops on its way to look, driving forwards, and backwards [s].

    If no scanner looks in the direction in which it drives, it turns round to look, and back,
    each time it has come to the end of what it saw: that is as far as plans lead.
    """
    known = request.known
    if known is None or not any(known.blind_turns):
        return 0.0, 0.0
    speed, turn_rate = request.forward.tolist()
    unknown = known.unknown_length(points)
    looks = max(unknown / (speed * plan_time), 1.0) if unknown else 0.0
    ahead, behind = (2.0 * looks * turn / turn_rate for turn in known.blind_turns)
    return ahead, behind


def fits(path: GeometricPath, request: PathRequest, margin: float) -> bool:
    """Whether all circles of a robot keep a margin [m] along a path, and where it begins and ends.

    Turns on the spot included.
    """
    corners = poses_along(path, request.start, request.goal)
    radius = float(request.outline[0, 2])
    reach = float(np.hypot(*request.outline[:, :2].T).max())
    steps = np.diff(corners, axis=0)
    moved = np.hypot(steps[:, 0], steps[:, 1]) + reach * np.abs(steps[:, 2])
    places = np.concatenate([[0.0], np.cumsum(moved)])
    count = min(2 + math.ceil(places[-1] / (0.5 * radius)), BODY_SAMPLES)
    along = np.linspace(0.0, places[-1], count)

    def distances_at(along: Array) -> Array:
        poses = np.stack([np.interp(along, places, column) for column in corners.T], axis=1)
        return outline_distances(request, poses)

    distances = distances_at(along)
    # where it stands now, and where it is to stand, it may be as near as it is
    needed = min(margin, float(distances[0]), float(distances[-1])) - CUT_DEPTH
    for _ in range(HALVINGS):
        unsure = distances[:-1] + distances[1:] - np.diff(along) < 2.0 * needed
        if not unsure.any() or (distances < needed).any():
            break
        after, between = np.flatnonzero(unsure) + 1, 0.5 * (along[:-1] + along[1:])[unsure]
        along = np.insert(along, after, between)
        distances = np.insert(distances, after, distances_at(between))
    return bool((distances >= needed).all())


def same_side(route: Route, path: GeometricPath, landmarks: Array) -> bool:
    """Tell whether two paths to one goal pass every obstacle on the same side, in the same gear.

    `route`: one of them. `path`: the other one. `landmarks`: a point in each obstacle, (L, 2) [m].
    """
    if route.reverse != path.reverse:
        return False
    turned = angle_swept(route.points, landmarks) - angle_swept(path.points, landmarks)
    return bool((np.abs(turned) < np.pi).all())
