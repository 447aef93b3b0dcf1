"""What a robot must stay clear of until it stands, and how near it comes: one function for all."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.kernels import NUMPY, Kernels
from kmpc_lite.control.kernels.clearance import (
    COLUMNS,
    SPREAD,
    SPREAD_MAX,
    SPREAD_RATE,
    VELOCITY,
)
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.solids import Nearby


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Things around a robot.

    A moving obstacle counts twice: where its velocity leads it, and wherever it can turn to.
    """

    things: Array
    """(M, 7) what is round, as it is now: a table of `kernels.clearance`."""
    nearby: Nearby | None = None
    """Solids that the robot can come to."""
    perhaps: Array = field(default_factory=lambda: np.empty((0, COLUMNS)))
    """(P, 7) what may be walking, and is else known as something that stands."""
    unsure: Array = field(default_factory=lambda: np.empty(0))
    """(M,) what is not known of the speeds of things; none where all are known."""
    swerve_time: float = 0.0
    """For how long a moving obstacle may walk in any direction [s]."""
    known: float = math.inf
    """How far from the middles of the robot's circles everything is known [m]."""
    emerging_speed: float = 0.0
    """At which something may come out of what is not known [m/s]."""
    unknown: Nearby | None = None
    """What scans have not shown to be free, where something may come out of it."""
    kernels: Kernels = NUMPY
    """Measure distances."""

    @cached_property
    def turning(self) -> Array:
        """What may turn (W, 7): spreads from where it is, as fast as it can be walking."""
        everything = np.concatenate([self.things, self.perhaps])
        speeds = np.hypot(*everything[:, VELOCITY].T)
        speeds[: len(self.unsure)] += self.unsure
        everything[:, VELOCITY] = 0.0
        everything[:, SPREAD_RATE] = speeds
        everything[:, SPREAD_MAX] = speeds * self.swerve_time
        found: Array = everything[speeds > 0.0]
        return found

    @cached_property
    def _all(self) -> Array:
        """Things (M + W, 7) where their velocities lead them, then what may turn."""
        straight = self.things.copy()
        straight[:, SPREAD] = 0.0
        return np.concatenate([straight, self.turning])

    @property
    def is_empty(self) -> bool:
        """Whether there is nothing to stay clear of."""
        something = len(self.things) or len(self.perhaps) or self.nearby
        return not something and self.known == math.inf

    @property
    def may_turn(self) -> Array:
        """Which of the things that `clearance` measures may turn towards the robot, (K,)."""
        after = bool(self.nearby) + (self.known < math.inf) + bool(self.unknown)
        return np.repeat((False, True, False), (len(self.things), len(self.turning), after))

    def fastest(self) -> float:
        """Largest speed at which anything may come nearer [m/s]."""
        walking = self.turning[:, SPREAD_RATE].max(initial=0.0)
        return float(
            max(walking, self.emerging_speed if self.unknown or self.known < math.inf else 0.0)
        )

    def clearance(self, points: Array, times: Array, here: Array) -> Array:
        """Distances from points to the edges of all things.

        Parameters
        ----------
        points : ndarray
            (C, Q, E, 2); Q may be 1 for points at rest [m].
        times : ndarray
            (Q,) from now [s].
        here : ndarray
            (E, 2) where the points are now [m].

        Returns
        -------
        ndarray
            (C, Q, E, K) [m], negative inside.
        """
        shape = (len(points), len(times), len(here))
        found = []
        if len(self._all):
            found.append(self.kernels.distances_of_motions(self._all, points, times))
        if self.nearby:
            least = self.nearby.least(points.reshape(-1, 2), self.kernels)
            found.append(np.broadcast_to(least.reshape(*points.shape[:3], 1), (*shape, 1)))
        if self.known < math.inf:
            # as the distance from an obstacle all around that comes nearer
            left = self.known - self.emerging_speed * times
            away = np.hypot(*np.moveaxis(points - here, -1, 0))
            found.append((left[:, None] - away)[..., None])
        if self.unknown:
            least = self.unknown.least(points.reshape(-1, 2), self.kernels)
            least = least.reshape(*points.shape[:3], 1) - self.emerging_speed * times[:, None, None]
            found.append(least)
        return np.concatenate(found, axis=-1)

    def slopes(self, here: Array, pose: Array, step: float) -> Array:
        """By how much clearances grow with the pose, in the robot's frame (E, K, 3).

        Parameters
        ----------
        here : ndarray
            (E, 2) middles of the robot's circles [m].
        pose : ndarray
            (3,) of the robot.
        step : float
            Of the differences that are taken [m].
        """
        moved = here + step * np.array(((0.0, 0.0), (1.0, 0.0), (0.0, 1.0)))[:, None]
        found = self.clearance(moved[:, None], np.zeros(1), here)[:, 0]
        x, y = (found[1:] - found[0]) / step
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        ahead, left = cos * x + sin * y, cos * y - sin * x
        arms = here - pose[:2]
        turned = arms[:, :1] * y - arms[:, 1:] * x
        return np.stack([ahead, left, turned], axis=-1)
