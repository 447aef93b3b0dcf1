"""Standing still at the goal: a zone in which the command is zero, left only when the robot is pushed out of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.tube import split_noise
from kmpc_lite.types import Array

QUIET = (0.006, 0.024)
"""Standard deviation of a measured pose [m, rad] up to which the zone is the same; a noisier one
widens it."""


@dataclass(frozen=True)
class GoalTolerances:
    """How near to the goal is there; each pair is [m, rad]."""

    close: float = 0.010
    """Distance at which the last turn may begin [m]."""
    keep: float = 0.015
    """A last turn that leaves this distance is given up [m]."""
    enter: tuple[float, float] = (0.015, 0.025)
    """Errors at which the robot has arrived."""
    leave: tuple[float, float] = (0.020, 0.05)
    """Errors of the averaged pose at which it drives again."""
    pushed: tuple[float, float] = (0.05, 0.15)
    """Errors of one single pose at which it drives again."""
    off_way: float = 0.01
    """Distance from its way at which a new one is looked for near the goal [m]."""


def goal_tolerances(model: KoopmanModel) -> GoalTolerances:
    """Zone for a robot whose pose is as noisy as its model has learned: what is left of the noise at rest.

    Every distance grows with the noise above `QUIET`, by so much that chance alone hardly passes
    it: single poses by 3 to 5 standard deviations, the averaged one by as many of its own, which
    are a third.
    """
    # a residual has the noise of the pose before and of the one after
    measured = 0.5 * split_noise(model.noise_model)[0]
    d = max(float(np.sqrt(0.5 * np.trace(measured[:2, :2]))) - QUIET[0], 0.0)
    a = max(float(np.sqrt(measured[2, 2])) - QUIET[1], 0.0)
    if not d + a > 0.0:
        return QUIET_TOLERANCES
    z = QUIET_TOLERANCES
    return GoalTolerances(
        close=z.close + d,
        keep=z.keep + 3.5 * d,
        enter=(z.enter[0] + d, z.enter[1] + a),
        leave=(z.leave[0] + 2.5 * d, z.leave[1] + 1.5 * a),
        pushed=(z.pushed[0] + 4.0 * d, z.pushed[1] + 4.5 * a),
        off_way=z.off_way + 3.0 * d,
    )


QUIET_TOLERANCES = GoalTolerances()
AVERAGING = 0.2
"""Share of the newest pose in the average: a robot at rest may average the noise of its pose
away."""


class GoalChecker:
    """Decides whether to stand still."""

    def __init__(self) -> None:
        self.zone = QUIET_TOLERANCES
        self.reset()

    def reset(self) -> None:
        """Forget that the robot stands at its goal."""
        self.holding = False
        self._error = np.zeros(3)

    def hold(self, error: Array, at_rest: Array | None = None) -> bool:
        """Whether the command is to be zero.

        Parameters
        ----------
        error : ndarray
            Pose less goal (3,) [m, m, rad], the heading's in [-pi, pi).
        at_rest : ndarray, optional
            The same of the pose at which the robot would stand if it braked now; `error` where not
            given.
        """
        zone = self.zone
        distance, turn = float(np.hypot(error[0], error[1])), abs(float(error[2]))
        if not self.holding:
            inside = distance <= zone.enter[0] and turn <= zone.enter[1]
            if inside and at_rest is not None:
                inside = bool(
                    np.hypot(at_rest[0], at_rest[1]) <= zone.enter[0]
                    and abs(at_rest[2]) <= zone.enter[1]
                )
            if inside:
                self.holding = True
                self._error = error.copy()
            return self.holding
        self._error += AVERAGING * (error - self._error)
        drift, mean_turn = (
            float(np.hypot(self._error[0], self._error[1])),
            abs(float(self._error[2])),
        )
        pushed = distance > zone.pushed[0] or turn > zone.pushed[1]
        if pushed or drift > zone.leave[0] or mean_turn > zone.leave[1]:
            self.holding = False
        return self.holding
