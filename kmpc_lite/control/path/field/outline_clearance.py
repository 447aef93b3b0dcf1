"""How far a robot's outline stays from what is around it, pose by pose."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.path.planner import PathRequest, distances_around
from kmpc_lite.control.path.turning_centre import seen_from
from kmpc_lite.types import Array

NEAR = 1.0
"""Clearance beyond the margin below which driving costs more [radii]."""
NEAR_PRICE = 1.0
"""What it costs more at the margin, as a share of its time."""
ROUNDING = 1e-9
CHUNK = 4096
"""Places that are looked at at once: what it needs of memory."""


class OutlineClearance:
    """Clearance of the circles of a request's outline.

    Start and goal may lie nearer to something than the margin allows: so near them the robot may
    come, no nearer.

    `request`: outline, obstacles and area. `margin`: what the problem keeps beyond the radii [m].
    """

    def __init__(self, request: PathRequest, margin: float) -> None:
        self._request, outline = request, request.outline
        self._least, self._kept = margin, 0.0
        ends = np.stack([request.start, request.goal])
        self._ends = ends[:, :2]
        self._radius = float(outline[:, 2].max())
        arms = np.hypot(outline[:, 0], outline[:, 1])
        self._reach = 2.0 * float((arms + outline[:, 2]).max())
        self._room_at_ends = outline_distances(request, ends) - margin
        self._near = NEAR * self._radius

    def keep(self, clearance: float) -> None:
        """Keep so much more than the margin from now on, start and goal aside [m]."""
        self._kept = clearance

    def on_way(self, poses: Array) -> Array:
        """Clearance beyond the margin (n,) of a path's poses (n, 3), its ends aside [m]."""
        found = self.room(poses)
        away = [np.hypot(*(poses[:, :2] - end).T) > self._reach for end in self._ends]
        out: Array = np.where(away[0] & away[1], found, np.inf)
        return out if np.isfinite(out).any() else found

    def room(self, poses: Array) -> Array:
        """Clearance beyond the margin (n,) at poses (n, 3) [m]; infinite in the open."""
        out: Array = outline_distances(self._request, poses) - self._least
        return out

    def at(self, poses: Array) -> Array:
        """Clearance (n,) at poses (n, 3) beyond what must be kept there [m]; below zero outside."""
        found = self.room(poses) - self._kept
        for place, room in zip(self._ends, self._room_at_ends, strict=True):
            lack = min(room - self._kept, 0.0)
            if lack < 0.0:
                near = np.hypot(*(poses[:, :2] - place).T) <= self._reach
                found = np.where(near, found - lack + ROUNDING, found)
        low, high = self._request.area
        inside = np.minimum(poses[:, :2] - low, high - poses[:, :2]).min(axis=1)
        found = np.where(inside >= -ROUNDING, found, -1.0)
        return found

    def price(self, clearance: Array) -> Array:
        """How many times its time driving costs at a clearance beyond the margin (...)."""
        out: Array = 1.0 + NEAR_PRICE * np.clip(1.0 - clearance / self._near, 0.0, 1.0)
        return out


def outline_distances(request: PathRequest, poses: Array) -> Array:
    """Distances (n,) of a robot's outline at poses (n, 3) from what is around it [m]."""
    outline = request.outline
    x, y, radii = outline.T
    if request.centre is not None:
        poses = seen_from(poses, -request.centre)
    cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    places = np.stack([poses[:, :1] + cos * x - sin * y, poses[:, 1:2] + sin * x + cos * y], -1)
    step = max(CHUNK // len(outline), 1)
    parts = [
        _distances(request, places[k : k + step].reshape(-1, 2), poses[k : k + step])
        for k in range(0, len(poses), step)
    ]
    found: Array = (np.concatenate(parts).reshape(len(poses), -1) - radii).min(axis=1)
    return found


def _distances(request: PathRequest, points: Array, poses: Array) -> Array:
    """Distances (n C,) of the circles' middles (n C, 2) at poses (n, 3) [m]."""
    footprint, solids, unit = request.footprint, request.solids, request.unit
    if footprint is None or solids is None:
        return request.distances(points)
    body = footprint.scaled(unit), poses / (unit, unit, 1.0)
    coarse = 0.0 if request.known is None else request.known.coarseness
    least = solids.whole.least(points / unit, body=body) * unit + coarse
    return np.minimum(least, distances_around(points, request.circles, None))
