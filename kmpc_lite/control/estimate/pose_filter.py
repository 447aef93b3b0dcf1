"""Where the robot is: the measured pose and the predicted one, each weighed by its noise.

A Kalman filter of the pose alone. It is the innovation's other half: what an innovation tells of
the floor makes predictions worth less, and one that is no motion ends the estimate
(`innovation.py`).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.estimate.history import DrivenPeriod
from kmpc_lite.geometry import nearest_turn
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import STATES, Array


class PoseEstimate(NamedTuple):
    """A pose, and how sure it is."""

    pose: Array
    """(3,)."""
    covariance: Array
    """(3, 3), in the map's frame."""

    @property
    def deviation(self) -> float:
        """Standard deviation of each coordinate [m]."""
        return math.sqrt(0.5 * float(self.covariance[0, 0] + self.covariance[1, 1]))

    @property
    def in_robot(self) -> Array:
        """The covariance (3, 3) in the robot's frame."""
        return _turned(self.covariance, -float(self.pose[2]))


def estimate(
    last: PoseEstimate | None,
    period: DrivenPeriod | None,
    model: MotionModel,
    moved: Array,
    measured: Array,
    pose: Array,
) -> PoseEstimate:
    """Estimate where the robot is.

    `last`: a period ago; none if nothing is known of that. `period`: what was commanded since; none
    if nobody knows. `model`: predicts. `moved`, `measured`: covariances (3, 3) of the motion in a
    period, and of a measured pose, in the robot's frame. `pose`: (3,) as measured now.
    """
    spread = _turned(measured, float(pose[2]))
    if last is None or period is None:
        return PoseEstimate(pose, spread)
    predicted = model.predict(last.pose, period.command, period.earlier)
    if not np.isfinite(predicted).all():
        return PoseEstimate(pose, spread)
    dx, dy, _ = (predicted - last.pose).tolist()
    by_pose = np.eye(STATES)
    by_pose[:2, 2] = -dy, dx
    covariance = by_pose @ last.covariance @ by_pose.T + _turned(moved, float(predicted[2]))
    gain = np.linalg.solve(covariance + spread, covariance).T
    off = pose - predicted
    off[2] -= nearest_turn(float(off[2]))
    found = predicted + gain @ off
    # the heading stays within half a turn of the measured one
    found[2] += nearest_turn(float(pose[2] - found[2]))
    left = covariance - gain @ covariance
    return PoseEstimate(found, 0.5 * (left + left.T))


def _turned(covariance: Array, heading: float) -> Array:
    """A covariance (3, 3) in a frame that is turned back by a heading [rad]."""
    cos, sin = math.cos(heading), math.sin(heading)
    turn = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    out: Array = turn @ covariance @ turn.T
    return out
