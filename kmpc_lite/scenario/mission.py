"""Routes from QGroundControl: the waypoints of a ``.plan`` file, as poses of a local frame."""

from __future__ import annotations

import json
import math
import os
from typing import Any

from kmpc_lite.errors import ScenarioError
from kmpc_lite.reading import read_bytes

LARGEST = 2**20
"""Longest plan that is read [bytes]."""
MOST_GOALS = 1000
FARTHEST = 5_000.0
"""Waypoints further away than this are not on one flat map with the origin [m]."""
WAYPOINT, RETURN = 16, 20
"""MAV_CMD_NAV_WAYPOINT and MAV_CMD_NAV_RETURN_TO_LAUNCH: all that is driven of a mission."""
HOLD, YAW, PARAMS = 0, 3, 7
"""Parameters of a waypoint: how long to wait there [s], and the heading from north [degrees]."""
GLOBAL_FRAMES = (0, 3, 5, 6, 10, 11)
"""MAV_FRAMEs in which x and y are latitude and longitude."""

Pose = tuple[float, float, float]
Place = tuple[float, float]


def read_mission(path: str | os.PathLike[str], origin: Place | None = None) -> list[Pose]:
    """Read the waypoints of a QGroundControl plan.

    Parameters
    ----------
    path : path
        A ``.plan`` file.
    origin : tuple, optional
        Latitude and longitude of the local frame's origin [degrees]; the plan's home if not given.

    Returns
    -------
    list of tuple
        Goals x east, y north [m], theta counter-clockwise from east [rad]. A waypoint without a
        heading (null or 0, as QGroundControl writes it) is arrived at as the robot comes from the
        one before.

    Raises
    ------
    ScenarioError
        Names the file and the item that cannot be driven.
    """
    mission = _mission(path)
    try:
        home = _place(mission.get("plannedHomePosition"), "plannedHomePosition")
    except ValueError as error:
        raise ScenarioError(f"{path}: {error}") from None
    items = mission.get("items")
    if not isinstance(items, list) or not 0 < len(items) <= MOST_GOALS:
        raise ScenarioError(f"{path}: mission.items: expected 1 to {MOST_GOALS} items")
    origin = home if origin is None else origin
    goals: list[Pose] = []
    before = _local(home, origin)
    for number, item in enumerate(items, 1):
        try:
            place, heading = _waypoint(item, home)
            x, y = _local(place, origin)
            if math.hypot(x, y) > FARTHEST:
                raise ValueError(f"{math.hypot(x, y) / 1e3:.1f} km from the origin")
        except ValueError as error:
            raise ScenarioError(f"{path}: item {number}: {error}") from None
        if heading is None:
            last = goals[-1][2] if goals else 0.0
            moved = x - before[0], y - before[1]
            heading = math.atan2(moved[1], moved[0]) if any(moved) else last
        goals.append((x, y, heading))
        before = x, y
    return goals


def _mission(path: str | os.PathLike[str]) -> dict[str, Any]:
    """Give the mission of a plan file; raises ScenarioError for what is none."""
    try:
        plan = json.loads(read_bytes(path, LARGEST))
    except OSError as error:
        raise ScenarioError(f"{path}: cannot read the route: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise ScenarioError(f"{path}: not JSON: {str(error)[:80]}") from None
    mission = plan.get("mission") if isinstance(plan, dict) else None
    if not isinstance(mission, dict) or plan.get("fileType") != "Plan":
        raise ScenarioError(f"{path}: expected a plan of QGroundControl, with a mission")
    return mission


def _waypoint(item: Any, home: Place) -> tuple[Place, float | None]:
    """Place of an item, and its heading [rad], None without one; raises ValueError."""
    if not isinstance(item, dict) or item.get("type") != "SimpleItem":
        kind = item.get("complexItemType", "?") if isinstance(item, dict) else "?"
        raise ValueError(f"expected a waypoint, got a complex item: {kind!s:.40}")
    command = item.get("command")
    if command == RETURN:
        return home, None
    if command != WAYPOINT:
        raise ValueError(
            f"command {command!s:.40} is not driven, only waypoints ({WAYPOINT}) and return to "
            f"launch ({RETURN}): remove it from the plan"
        )
    params = item.get("params")
    if not isinstance(params, list) or len(params) != PARAMS:
        raise ValueError(f"params: expected {PARAMS} numbers")
    if item.get("frame") not in GLOBAL_FRAMES:
        raise ValueError(f"frame {item.get('frame')!s:.40} has no latitude and longitude")
    if params[HOLD]:
        raise ValueError(f"waits of {params[HOLD]!s:.40} s are not made: set hold to 0")
    heading = None
    if params[YAW]:
        heading = math.radians(math.remainder(90.0 - _number(params[YAW], "heading"), 360.0))
    return _place(params[4:6], "params 5 and 6"), heading


def _place(value: Any, name: str) -> Place:
    """Latitude and longitude [degrees]; raises ValueError."""
    if not isinstance(value, list) or len(value) < 2:
        raise ValueError(f"{name}: expected latitude and longitude")
    return check_place(_number(value[0], name), _number(value[1], name))


def check_place(latitude: float, longitude: float) -> Place:
    """Give a place on Earth; raises ValueError for what is none, and for 0, 0: that is unset."""
    if not (abs(latitude) < 90.0 and abs(longitude) <= 180.0) or latitude == longitude == 0.0:
        raise ValueError(f"no place on Earth: latitude {latitude:g}, longitude {longitude:g}")
    return latitude, longitude


def _number(value: Any, name: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= 1e9:
        raise ValueError(f"{name}: expected a number, got {value!s:.40}")
    return float(value)


def _local(place: Place, origin: Place) -> Place:
    """Metres east and north of the origin."""
    import numpy as np

    from kmpc_lite.learn.formats.streams import local_metres

    (_, _), (north, east) = local_metres(*np.array((origin, place)).T).tolist()
    return east, north
