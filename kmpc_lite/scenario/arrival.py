"""When a drive counts as arrived: by the true pose, for every loop that is closed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.geometry import distances, wrap
from kmpc_lite.types import Array


@dataclass(frozen=True)
class Tolerance:
    """How far from its goal a robot may be and be there."""

    distance: float
    """[m]"""
    heading: float
    """[rad]"""

    def met(self, poses: Array, goal: Array) -> NDArray[np.bool_]:
        """Whether poses (..., 3) are within both of a goal (3,), (...).

        Examples
        --------
        >>> poses = np.array([[0.0, 0.04, 6.2], [0.0, 0.06, 0.0], [0.0, 0.0, 0.2]])
        >>> ARRIVED.met(poses, np.zeros(3)).tolist()
        [True, False, False]
        """
        near = distances(poses, goal) <= self.distance
        turned = np.abs(wrap(poses[..., 2] - goal[2])) <= self.heading
        return np.asarray(near & turned)


ARRIVED = Tolerance(0.05, 0.15)
"""Of the paper's table, and of a scenario that does not say otherwise."""


def in_pose(radius: float, spread: Array) -> Tolerance:
    """Tolerance of a robot of any size: a tenth of its radius [m], and 0.1 rad.

    Measured poses that err by more, of standard deviations (3,) [m, m, rad], widen it: to three of
    them.
    """
    return Tolerance(max(0.1 * radius, 3.0 * float(spread[0])), max(0.1, 3.0 * float(spread[2])))
