"""What the guidance tells the controller in each step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kmpc_lite.control.path.situation import Situation
from kmpc_lite.control.plan import NO_PROGRESS, GoalProgress
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.state import GuideState

NO_TURNS = np.empty(0)
TOLD_STALLS = 2
"""Stalls after which the guidance says that the robot waits: the second follows when something else
was tried and did not help either."""


class Guidance(NamedTuple):
    """Where to steer."""

    states: Array
    """(N + 1, 3) reference of the stages; headings next to the robot's."""
    reachable: bool
    """Whether there is a path to the goal."""
    hold: bool
    """Whether the robot is to stand still: it is at the goal, or at the pose in the area that is
    nearest to it."""
    path: Array
    """(K, 2) points of the path from where it was planned to the goal [m]; the place to wait where
    there is none."""
    time_left: float
    """Until the goal is reached [s]; infinite where it cannot be."""
    refreshed: bool
    """Whether a new path was found in this step, or that there is none."""
    switched: bool
    """Whether the new path goes another way around, so that a plan along the old one is no good
    start."""
    progress: GoalProgress
    """What the robot does about its goal."""
    reason: str
    """Why it neither drives there nor holds."""
    share_at_goal: float
    """Of the stages: at how many the reference has come to the goal's position."""
    path_clearance: float | Array
    """What the path keeps beyond the problem's margin [m], or at each stage, (N, 1); less where a
    passage is narrow, or the goal lies between obstacles."""


def wait_in_sight(
    states: Array, state: GuideState, now: Situation, known: float, body: float, turn: float
) -> None:
    """Let the reference (N + 1, 3) wait where it would lead into what is not known.

    A plan that is drawn farther than it may go is solved badly. A robot that waits where no
    scanner looks turns round to look.

    Parameters
    ----------
    states : ndarray
        Changed.
    state : GuideState
        Updated: whether it looks.
    now : Situation
        Robot, and what scans have shown.
    known : float
        How far from the robot everything is told [m]; infinite where it always is.
    body : float
        Distance that the robot keeps from what is unknown [m].
    turn : float
        How far it turns from stage to stage [rad].
    """
    view = now.view
    if view is None and known == math.inf:
        return
    dark = np.zeros(len(states), dtype=bool)
    if known < math.inf:
        dark = np.hypot(*(states[:, :2] - now.pose[:2]).T) > known
    if view is not None:
        dark |= view.is_dark(states[:, :2], 0.0)
        if view.is_narrow:
            dark |= view.leads_into_dark(states[:, :2], now.pose[:2], body)
    first = int(dark.argmax())
    waits = bool(dark[first])
    turns = NO_TURNS
    if waits and view is not None and view.is_narrow:
        turns = view.turns_to_see(states[dark, :2], body, turn)
    # once it has stopped to look, it looks as far as the reference leads: each look is a stop
    state.looking = len(turns) > 0 and (state.looking or first <= 1)
    if state.looking:
        aim = float(turns[np.abs(turns).argmin()])
        states[:] = now.pose
        turned = np.minimum(turn * np.arange(1, len(states) + 1), abs(aim))
        states[:, 2] += math.copysign(1.0, aim) * turned
    elif waits:
        states[first:] = states[max(first - 1, 0)]


def told_progress(
    state: GuideState, hold: bool, scale: float | None, gets_on: bool
) -> tuple[GoalProgress, str]:
    """Tell what a robot on its path does about its goal, and why it does not drive there.

    `scale` is the share of the speed that moving obstacles leave it; none: it makes room for them.
    `gets_on` is whether it has left some of its path behind since it stalled last.
    """
    if hold:
        return GoalProgress.HOLDING, ""
    if scale is None:
        return GoalProgress.DRIVING, ""
    if scale == 0.0:
        return GoalProgress.WAITING, "something that moves is let pass"
    if state.progress.stalls >= TOLD_STALLS and not gets_on:
        return GoalProgress.WAITING, NO_PROGRESS
    return GoalProgress.DRIVING, ""
