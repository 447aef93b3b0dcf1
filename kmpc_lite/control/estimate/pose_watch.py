"""Whether a pose is one that the robot can have come to: a jump is no slip.

A pose that differs from the predicted one by more than commands, slip and the pose's own noise can
make was never driven to: the localisation has jumped. From then on the place is predicted from the
last pose that was believed. A pose that comes back to that place is believed at once; others are
believed when they have agreed with themselves, as the wheels say, for long enough. While poses are
lost, both go on as predicted: the first that comes again is compared with where the robot can have
come to meanwhile.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kmpc_lite.control.estimate.command_history import CommandHistory
from kmpc_lite.control.margins.model_noise import ModelNoise
from kmpc_lite.control.options import PoseOptions, lengths_from_radii, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import Array


@dataclass(slots=True)
class PoseWatchState:
    """The pose before, and whether it is doubted."""

    last: Array | None = None
    """(3,) as measured in the last step, predicted since where no pose came."""
    unseen: tuple[float, float] = (0.0, 0.0)
    """By how much that place and heading may be off: slip since the last pose that came."""
    believed: Array | None = None
    """(3,) predicted since the last pose that was believed; None: poses are believed."""
    jump: tuple[float, float] = (0.0, 0.0)
    """Size of the jump, in position and heading."""
    strayed: tuple[float, float] = (0.0, 0.0)
    """By how much the believed place and heading may be off: slip since the jump."""
    agreed: float = 0.0
    """For how long poses have agreed with themselves."""
    elsewhere: bool = False
    """Whether in this step a doubt has ended otherwise than by a pose that came back."""
    pace: tuple[float, float] = (0.0, 0.0)
    """Fastest commands of late, v and omega."""


class PoseWatch:
    """Tells poses that have jumped.

    Parameters
    ----------
    problem : NavigationProblem
        Period and unit length.
    options : PoseOptions
        What is tolerated, and for how long poses must agree.
    """

    def __init__(self, problem: NavigationProblem, options: PoseOptions) -> None:
        self._dt = problem.dt
        self._options = lengths_from_radii(options, unit_length(problem))
        self._fading = math.exp(-problem.dt / options.slip_memory)

    def see(
        self,
        state: PoseWatchState,
        history: CommandHistory,
        model: MotionModel,
        noise: ModelNoise,
        pose: Array | None,
    ) -> Array | None:
        """Take in a pose (3,), and tell where the robot is instead if it is doubted.

        Parameters
        ----------
        state : PoseWatchState
            Updated.
        history : CommandHistory
            What was sent in the past period, which is left out of all that learns where a pose
            jumps.
        model : MotionModel
            Predicts.
        noise : ModelNoise
            Of that model: what measured poses add.
        pose : ndarray, optional
            Measured; none where it is lost, which others take care of.

        Returns
        -------
        ndarray or None
            (3,) the predicted pose; None where the measured one is believed.
        """
        last, state.last = state.last, pose
        before, doubted = history.driven, state.believed is not None
        state.elsewhere = False
        if last is None or before is None:
            # nobody knows what was sent, or where the robot was
            _give_up(state)
            return None
        slip = self._slip(state, before.command)
        unseen = _added(state.unseen, slip)
        planned = history.planned
        if planned is not None and planned.expected is not None and not doubted:
            step = planned.expected  # of the same place and command
        else:
            step = model.predict(last, before.command, before.earlier)
        places = step
        if state.believed is not None:
            state.believed = model.predict(state.believed, before.command, before.earlier)
            state.strayed = _added(state.strayed, slip)
            places = step + state.believed
        if not np.isfinite(places).all():
            _give_up(state)  # a model that drifts has been followed for too long
            return None
        if pose is None:
            state.last, state.unseen = step, unseen
            return None
        state.unseen = (0.0, 0.0)
        bounds = self._bounds(noise, unseen)
        agrees = _within(pose, step, *bounds)
        if not doubted and (agrees or not self._options.agreement):
            return None
        # what happens from pose to pose then tells nothing of the floor
        history.driven = history.planned = None
        if state.believed is None:
            state.believed, state.jump = step, _difference(pose, step)
            state.agreed, state.strayed = 0.0, unseen
            return step
        state.agreed = state.agreed + self._dt if agrees else 0.0
        strayed = state.strayed
        near = _within(pose, state.believed, bounds[0] + strayed[0], bounds[1] + strayed[1])
        # what comes back must jump, too; what does not is not back, however near
        back, state.elsewhere = near and not agrees, state.agreed >= self._options.agreement
        if back or state.elsewhere:
            state.believed = None
        return state.believed

    def _slip(self, state: PoseWatchState, command: Array) -> tuple[float, float]:
        """How far slip may lead away in a period, in position and heading."""
        (v, omega), (fast, turning) = speeds(command).tolist(), state.pace
        state.pace = max(abs(v), self._fading * fast), max(abs(omega), self._fading * turning)
        options, dt = self._options, self._dt
        return options.slip * dt * state.pace[0], options.turn_slip * dt * state.pace[1]

    def _bounds(self, noise: ModelNoise, slip: tuple[float, float]) -> tuple[float, float]:
        """Largest differences from a prediction that are no jump, in position and heading."""
        position, heading = noise.pose_errors
        options = self._options
        return (
            max(options.tolerated, position) + slip[0],
            max(options.tolerated_turn, heading) + slip[1],
        )


def _give_up(state: PoseWatchState) -> None:
    """Predict no longer: the pose is believed as it comes."""
    state.elsewhere = state.believed is not None
    state.believed, state.unseen = None, (0.0, 0.0)


def _added(strayed: tuple[float, float], slip: tuple[float, float]) -> tuple[float, float]:
    """By how much a place and a heading may be off with another period's independent slip."""
    return math.hypot(strayed[0], slip[0]), math.hypot(strayed[1], slip[1])


def _difference(pose: Array, expected: Array) -> tuple[float, float]:
    """How far a pose is from the expected one, in position and heading."""
    x, y, turned = (pose - expected).tolist()
    return math.hypot(x, y), abs(math.remainder(turned, math.tau))


def _within(pose: Array, expected: Array, position: float, heading: float) -> bool:
    """Whether a pose is as near to the expected one as told."""
    away, turned = _difference(pose, expected)
    return away <= position and turned <= heading
