"""Bring a pose forward over its age.

A pose is old when it arrives; the commands that were sent meanwhile tell where the robot is now.
The largest age that is accepted is `StepOptions.oldest_pose`.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.options import StepOptions
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.motion import MotionModel, unmodelled_delay
from kmpc_lite.types import Array


def whole_age(pose_age: float, model: KoopmanModel, options: StepOptions) -> float:
    """Age of a pose, and how late the robot answers beyond what its model knows [s].

    To a model without input history a pose that shows old commands is an old pose.
    """
    delay = unmodelled_delay(model)
    oldest = min(options.oldest_pose, options.oldest_pose_periods * model.dt)
    return max(pose_age, min(pose_age + delay, oldest))


def advance_pose(model: MotionModel, pose: Array, sent: Array, age: float) -> Array:
    """Predict where the robot is now from where it was.

    Parameters
    ----------
    model : MotionModel
        Its period is that of the commands. Dead time and motor lag that it has learned with its
        input history are part of it, not of the pose's age.
    pose : ndarray
        Measured (3,).
    sent : ndarray
        Commands already sent, oldest first, (K, 2), one per period; those before the first are
        taken to be zero.
    age : float
        Of the pose, at the moment that the next command acts [s]; not negative.

    Returns
    -------
    ndarray
        Pose (3,) now.

    Examples
    --------
    >>> from kmpc_lite import nominal_unicycle
    >>> sent = np.array([[0.2, 0.0], [0.4, 0.0]])
    >>> advance_pose(nominal_unicycle(0.1), np.zeros(3), sent, age=0.15).round(3)
    array([0.05, 0.  , 0.  ])
    """
    periods = max(age, 0.0) / model.dt
    whole = int(np.ceil(periods - 1e-6))
    if whole == 0:
        return pose
    needed = whole + model.history
    commands = np.zeros((needed, model.inputs))
    known = min(len(sent), needed)
    commands[needed - known :] = sent[len(sent) - known :]
    # a pose that is older than k periods and younger than k + 1 saw a part of one command: that
    # share of the step is left to do. Taken as a straight piece of the step: off by v omega dt^2 /
    # 8 at most, 0.6 mm at 0.6 m/s, pi/4 rad/s and 0.1 s
    states = model.rollout(pose, commands[model.history :], commands[: model.history])
    first = 1.0 - (whole - periods)
    if first > 1.0 - 1e-6:
        last: Array = states[-1]
        return last
    begun: Array = pose + first * (states[1] - pose)
    if whole == 1:
        return begun
    now: Array = model.rollout(
        begun, commands[model.history + 1 :], commands[1 : model.history + 1]
    )[-1]
    return now
