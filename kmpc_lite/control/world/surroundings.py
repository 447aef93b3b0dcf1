"""What a robot must stay clear of until it stands, and how near it comes: one function for all."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.clearance import (
    COLUMNS,
    SPREAD,
    SPREAD_MAX,
    SPREAD_RATE,
    VELOCITY,
    some_move,
    some_spread,
)
from kmpc_lite.geometry import rotate
from kmpc_lite.types import STATES, Array

if TYPE_CHECKING:
    from kmpc_lite.control.footprint import Footprint
    from kmpc_lite.control.world.solids import Body, Nearby


NONE = np.empty((0, COLUMNS))
KNOWN = np.empty(0)


class Surroundings:
    """Things around a robot.

    A moving obstacle counts twice: where its velocity leads it, and wherever it can turn to.

    `things`: (M, 7) what is round, as it is now: a table of `kernels.clearance`. `nearby`: solids
    that the robot can come to. `perhaps`: (P, 7) what may be walking, and is else known as
    something that stands. `unsure`: (M,) what is not known of the speeds of things; (0,) if all are
    known. `swerve_time`: for how long a moving obstacle may walk in any direction [s]. `known`: how
    far from the middles of the robot's circles everything is known [m]. `emerging_speed`: at which
    something may come out of what is not known [m/s]. `unknown`: what scans have not shown to be
    free, where something may come out of it.

    Attributes: `turning`: (W, 7) what may turn: spreads from where it is, as fast as it can be
    walking.
    """

    def __init__(
        self,
        things: Array,
        nearby: Nearby | None = None,
        perhaps: Array = NONE,
        unsure: Array = KNOWN,
        swerve_time: float = 0.0,
        known: float = math.inf,
        emerging_speed: float = 0.0,
        unknown: Nearby | None = None,
    ) -> None:
        self.things, self.nearby, self.unknown = things, nearby, unknown
        self.known, self.emerging_speed = known, emerging_speed
        self.is_empty = not (len(things) or len(perhaps) or nearby) and known == math.inf
        self.turning, straight = NONE, things
        if len(perhaps) or some_move(things) or np.count_nonzero(unsure):
            turning = np.concatenate([things, perhaps])
            speeds = np.hypot(turning[:, 3], turning[:, 4])
            speeds[: len(unsure)] += unsure
            turning[:, VELOCITY] = 0.0
            turning[:, SPREAD_RATE] = speeds
            turning[:, SPREAD_MAX] = speeds * swerve_time
            self.turning = turning[speeds > 0.0]
        if some_spread(things):
            straight = things.copy()
            straight[:, SPREAD] = 0.0
        # things where their velocities lead them, then what may turn
        self._all = np.concatenate([straight, self.turning]) if len(self.turning) else straight

    @property
    def may_turn(self) -> Array:
        """Which of the things that `clearance` measures may turn towards the robot, (K,)."""
        after = bool(self.nearby) + (self.known < math.inf) + bool(self.unknown)
        return np.repeat((False, True, False), (len(self.things), len(self.turning), after))

    def fastest(self) -> float:
        """Largest speed at which anything may come nearer [m/s]."""
        walking = np.maximum.reduce(self.turning[:, SPREAD_RATE], initial=0.0)
        return float(
            max(walking, self.emerging_speed if self.unknown or self.known < math.inf else 0.0)
        )

    def clearance(
        self, points: Array, times: Array, here: Array, body: Body | None = None
    ) -> Array:
        """Distances from points to the edges of all things.

        `points`: (C, Q, E, 2); Q may be 1 for points at rest [m]. `times`: (Q,) from now [s].
        `here`: (E, 2) where the points are now [m]. `body`: footprint and poses (C Q, 3) whose
        circles the points are. Returns (C, Q, E, K) [m], negative inside.
        """
        shape = (len(points), len(times), len(here))
        found = []
        if len(self._all):
            found.append(library.distances_of_motions(self._all, points, times))
        if self.nearby:
            least = self.nearby.least(points.reshape(-1, 2), body)
            least = least.reshape(*points.shape[:3], 1)
            moves = points.shape[1] == len(times)
            found.append(least if moves else np.broadcast_to(least, (*shape, 1)))
        if self.known < math.inf:
            # as the distance from an obstacle all around that comes nearer
            left = self.known - self.emerging_speed * times
            away = np.hypot(*np.moveaxis(points - here, -1, 0))
            found.append((left[:, None] - away)[..., None])
        if self.unknown:
            least = self.unknown.least(points.reshape(-1, 2))
            least = least.reshape(*points.shape[:3], 1) - self.emerging_speed * times[:, None, None]
            found.append(least)
        return found[0] if len(found) == 1 else np.concatenate(found, axis=-1)

    def slopes(
        self, here: Array, pose: Array, step: float, footprint: Footprint | None = None
    ) -> Array:
        """By how much clearances grow with the pose, in the robot's frame (E, K, 3).

        `here`: (E, 2) middles of the robot's circles [m]. `pose`: (3,) of the robot. `step`: of the
        differences that are taken [m]. `footprint`: whose circles the points are.
        """
        steps = step * np.array(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))
        moved, body = here + steps[:, None], None
        if footprint is not None:
            body = footprint, pose + np.pad(steps, ((0, 0), (0, 1)))
        found = self.clearance(moved[:, None], np.zeros(1), here, body)[:, 0]
        slopes, arms = (found[1:] - found[0]) / step, here - pose[:2]
        # none is steeper than one, but for rounding: an outline's next nearest point jumps
        size = np.hypot(*slopes)
        x, y = np.where(size > 1.001, slopes / size, slopes)
        out = np.empty((*x.shape, STATES))
        out[..., 0], out[..., 1] = rotate(x, y, -float(pose[2]))
        out[..., 2] = arms[:, :1] * y - arms[:, 1:] * x
        return out
