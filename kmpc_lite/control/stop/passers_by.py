"""Who moves may turn on the spot: how fast a robot may drive beside him.

Nobody is driven into who can be anywhere within his reach by the time that the robot stands: what
leads away from him is always allowed, what leads past him more slowly the nearer he is, and where
he can be at the robot by then, it stands. He walks as fast as he is known to, and faster by what is
not known of it: who has just turned round is seen to walk slowly.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.options import StopOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.control.stop.braking import Braking
from kmpc_lite.types import Array


class PassersBy:
    """Looks at who moves beside the coming command.

    Parameters
    ----------
    problem : NavigationProblem
        Period and robot radius.
    braking : Braking
        The ramp.
    options : StopOptions
        For how long who moves may walk anywhere, and what makes room for him.
    """

    def __init__(self, problem: NavigationProblem, braking: Braking, options: StopOptions) -> None:
        self._dt, self._radius, self._braking = problem.dt, problem.body_radius, braking
        self._footprint = problem.footprint
        self._ramps = RateLimit(problem).active
        self._longest = max(options.swerve_time, problem.dt)
        self._away = options.makes_room

    def share(
        self, circles: Array, speeds: Array, states: Array, command: Array, history: int
    ) -> float:
        """Share of a command that drives into nobody who turns on the spot.

        Parameters
        ----------
        circles : ndarray
            (M, 7) as they are now.
        speeds : ndarray
            (M,) at which they can be walking at the most; zero for those at rest.
        states : ndarray
            The plan (N + 1, 3), whose first period is the coming one.
        command : ndarray
            The coming one (2,).
        history : int
            Periods by which the robot lags.
        """
        ramp = self._braking.periods(*command.tolist()) if self._ramps else 0.0
        time = min(self._dt * (1.0 + history + ramp), self._longest)
        if self._footprint is None:
            places = states[:2, None, :2]
        else:
            places = self._footprint.places(states[:2])
        return min(
            share_beside(circles, speeds, here, there, self._radius, time, self._away)
            for here, there in places.transpose(1, 0, 2)
        )


def share_beside(
    circles: Array,
    speeds: Array,
    here: Array,
    there: Array,
    radius: float,
    time: float,
    away: float,
) -> float:
    """Share from 0 to 1 of a motion that ends where nobody who moves can be.

    Parameters
    ----------
    circles : ndarray
        (M, 5) rows x, y, radius, vx, vy; their velocities do not count.
    speeds : ndarray
        (M,) at which they can be walking at the most; those at rest do not count.
    here, there : ndarray
        Positions (2,) at which the robot begins, and at which it would stand.
    radius : float
        Of the robot.
    time : float
        Until it stands: so long who moves may walk in any direction.
    away : float
        Cosine of the angle to the direction straight away from somebody up to which a motion makes
        room for him.

    Examples
    --------
    >>> person, speed = np.array([[1.0, 0.0, 0.25, 0.0, 1.0]]), np.ones(1)
    >>> here = np.zeros(2)
    >>> share_beside(person, speed, here, np.array([0.2, 0.0]), 0.15, 0.1, 0.5)
    1.0
    >>> share_beside(person, speed, here, np.array([0.2, 0.0]), 0.15, 0.7, 0.5)
    0.0
    >>> share_beside(person, speed, here, np.array([-0.2, 0.0]), 0.15, 0.7, 0.5)
    1.0
    """
    step = there - here
    length = float(np.hypot(step[0], step[1]))
    if not length:
        return 1.0
    apart = here - circles[:, :2]
    distance = np.hypot(apart[:, 0], apart[:, 1])
    gaps = distance - circles[:, 2] - radius - time * speeds
    towards = away * length - (apart @ step) / np.maximum(distance, radius)
    approach = np.where(speeds > 0.0, towards, 0.0)
    closing = approach > np.maximum(gaps, 0.0)
    if not closing.any():
        return 1.0
    return float((np.maximum(gaps[closing], 0.0) / approach[closing]).min())
