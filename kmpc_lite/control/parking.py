"""Standing still at the goal: a zone in which the command is zero, left only when the robot is pushed out of it."""

from __future__ import annotations

import numpy as np

from kmpc_lite.dictionary import Array

CLOSE = 0.010
"""Distance to the goal at which the last turn may begin [m]."""
ENTER = (0.015, 0.025)
"""Errors at which the robot has arrived [m, rad]; a last turn that leaves this distance is given up."""
LEAVE = (0.020, 0.05)
"""Errors of the averaged pose at which it drives again [m, rad]."""
PUSHED = (0.05, 0.15)
"""Errors of one single pose at which it drives again [m, rad]."""
AVERAGING = 0.2
"""Share of the newest pose in the average: a robot at rest may average the noise of its pose away."""


class Parking:
    """Decides whether to stand still."""

    def __init__(self) -> None:
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
            The same of the pose at which the robot would stand if it braked now; `error` where not given.
        """
        distance, turn = float(np.hypot(error[0], error[1])), abs(float(error[2]))
        if not self.holding:
            inside = distance <= ENTER[0] and turn <= ENTER[1]
            if inside and at_rest is not None:
                inside = bool(np.hypot(at_rest[0], at_rest[1]) <= ENTER[0] and abs(at_rest[2]) <= ENTER[1])
            if inside:
                self.holding = True
                self._error = error.copy()
            return self.holding
        self._error += AVERAGING * (error - self._error)
        drift, mean_turn = float(np.hypot(self._error[0], self._error[1])), abs(float(self._error[2]))
        pushed = distance > PUSHED[0] or turn > PUSHED[1]
        if pushed or drift > LEAVE[0] or mean_turn > LEAVE[1]:
            self.holding = False
        return self.holding
