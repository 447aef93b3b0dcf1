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
from kmpc_lite.geometry import nearest_turn, rotate
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import Array


class PoseEstimate(NamedTuple):
    """A pose, and how sure it is."""

    pose: Array
    """(3,)."""
    covariance: Array
    """(3, 3), in the robot's frame."""

    @property
    def deviation(self) -> float:
        """Standard deviation of each coordinate [m]."""
        return math.sqrt(0.5 * float(self.covariance[0, 0] + self.covariance[1, 1]))


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
    if last is None or period is None:
        return PoseEstimate(pose, measured)
    predicted = model.predict(last.pose, period.command, period.earlier)
    if not np.isfinite(predicted).all():
        return PoseEstimate(pose, measured)
    x, y, heading = predicted.tolist()
    dx, dy, turned = (predicted - last.pose).tolist()
    # the last error in the frame that the robot has turned to: one of its heading leads aside
    ahead, left = rotate(dx, dy, -heading)
    cos, sin = math.cos(turned), math.sin(turned)
    carried = np.array(((cos, sin, -left), (-sin, cos, ahead), (0.0, 0.0, 1.0)))
    covariance = carried @ last.covariance @ carried.T + moved
    gain = np.linalg.solve(covariance + measured, covariance).T
    off_x, off_y, off_turn = (pose - predicted).tolist()
    off_turn -= float(nearest_turn(off_turn))
    ahead, left, turn = (gain @ (*rotate(off_x, off_y, -heading), off_turn)).tolist()
    dx, dy = rotate(ahead, left, heading)
    # the heading stays within half a turn of the measured one
    found = np.array((x + dx, y + dy, float(pose[2]) - off_turn + turn))
    left_over = covariance - gain @ covariance
    return PoseEstimate(found, 0.5 * (left_over + left_over.T))
