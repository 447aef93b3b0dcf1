"""How far a command may be from the one before it, how a robot brakes, and whether it can move.

Ramps of model and problem limit each other when a controller is made; a robot that could not move
at all is refused.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kmpc_lite.control.options import fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.errors import ProblemError
from kmpc_lite.model.dictionary import ResponseDictionary
from kmpc_lite.model.file import Ramps
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, STATES, Array

ROUNDING = 1.0 + 1e-9  # factor by which a change may be larger than allowed
LONGEST_RAMP = 30.0  # no robot drives faster than it can stop from within this time [s]
LITTLE = 1e-9  # rounding error of a count of periods
SLOWEST = 300.0  # longest time for a way of the robot's radius, or a turn of half a radian [s]
HALF_RADIAN = 0.5
START_TIME = 60.0  # from rest, it comes within this time [s] to ...
STARTED = 0.1  # ... this share of its fastest speed and turn rate at the least.
FOLLOWED = 0.01  # share of its fastest commands that a model must let the robot follow at the least
PROMPT = 0.05  # share of a period by which a robot may answer late and still do so at once
AXES = (("speed", "m/s"), ("turn rate", "rad/s"))


class RateLimit:
    """Limits on the change of commands from one period to the next, and braking ramps.

    `problem`: `du_max`, `deceleration`, and the period.

    Attributes: `active`: whether anything is limited. `faster`, `slower`: by how much commands may
    change in a period, away from zero and towards it. `ramp_step`: by how much a braked command may
    shrink in a period [m/s, rad/s]. `longest_ramp`: periods of the longest ramp.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        self.active = problem.limits_changes
        self._within = problem.wheels.within
        self.faster = problem.dt * problem.du_max
        self.slower = problem.dt * np.maximum(problem.du_max, problem.deceleration)
        self.ramp_step: Array = np.asarray(problem.deceleration) * problem.dt
        self.longest_ramp = len(self.ramp(np.maximum(-problem.u_min, problem.u_max)))
        if self.active:
            self._reach = np.arange(1, problem.horizon + 1)[:, None] * self.faster

    def limit(self, command: Array, last: Array) -> Array:
        """Go from the last command (2,) towards a new one (2,) as far as is allowed.

        Speed and turn rate change by one share. A speed that shrinks may do so at the problem's
        deceleration where that is more.
        """
        if not self.active:
            return command
        change = command - last
        slower = np.maximum(self.faster, np.minimum(self.slower, np.abs(last)))
        allowed = np.where(change * last < 0.0, slower, self.faster)
        size = np.abs(change)
        over = size > allowed * ROUNDING
        if not over.any():
            return command
        limited = last + float((allowed[over] / size[over]).min()) * change
        return self._within(limited)

    def first(self, last: Array) -> tuple[Array, Array]:
        """Least and largest first command of a plan, (2,) each."""
        return last - self.faster, last + self.faster

    def in_reach(self, inputs: Array, last: Array) -> Array:
        """Bring the commands of a guess (N, 2) as near to the last command (2,) as they must be.

        Zeros become a braking ramp.
        """
        return np.clip(inputs, last - self._reach, last + self._reach)

    def ramp(self, command: Array) -> Array:
        """Commands (T, 2) that brake a robot after a command (2,); the last is zero.

        Both speeds shrink by one factor, so that the robot keeps to the curve that it is on.
        """
        periods = float((np.abs(command) / self.ramp_step).max())
        count = max(1, math.ceil(periods - LITTLE))
        shares = 1.0 - np.arange(1, count + 1) / max(periods, LITTLE)
        shares[-1] = 0.0
        return np.asarray(shares[:, None] * command)


def movable(model: KoopmanModel, problem: NavigationProblem) -> NavigationProblem:
    """Return the problem within what the model knows of how fast its robot changes its speeds.

    Raises ProblemError for limits, or a model, with which the robot would stand for ever: names the
    limit, and what the robot could do at the most.
    """
    ramps = Ramps.of(model.info).within(Ramps.of(model.info, "changes"))
    changes = np.minimum(problem.du_max, problem.deceleration)
    changes[np.isinf(problem.du_max)] = np.inf
    problem = within_ramps(replace(problem, du_max=changes), ramps)
    most = LONGEST_RAMP * problem.deceleration
    u_min, u_max = np.maximum(problem.u_min, -most), np.minimum(problem.u_max, most)
    problem = replace(problem, u_min=u_min, u_max=u_max)
    largest = np.array(fastest(problem))
    least = np.array((unit_length(problem), HALF_RADIAN)) / SLOWEST
    for (name, unit), value, needed in zip(AXES, largest.tolist(), least.tolist(), strict=True):
        if value < needed:
            raise ProblemError(
                f"u_min, u_max: the {name} is at most {value:.2g} {unit}, and the robot would "
                f"stand: at least {needed:.2g} {unit} are needed"
            )
    _check_wheels(problem, least)
    changes = problem.du_max[[0, -1]]
    for (name, unit), value, change in zip(AXES, largest.tolist(), changes.tolist(), strict=True):
        needed = STARTED * value / START_TIME
        if change < needed:
            raise ProblemError(
                f"du_max, or ramps of the model: the {name} changes by at most {change:.2g} "
                f"{unit}^2, and the robot would stand: at least {needed:.2g} {unit}^2 are needed "
                f"for {value:.2g} {unit}"
            )
    _check_sight(problem)
    check_motion(model, problem)
    return problem


def following(model: KoopmanModel, problem: NavigationProblem) -> KoopmanModel:
    """Return a model of a robot that takes the time which its limits say to follow a command.

    What changes by a ramp within a period has on average only half changed during it; a limit that
    is a share of what the robot brakes with costs that share of it. A learned model has seen how
    its robot follows, and stays as it is.
    """
    if model.noise_model is not None or model.history or model.inputs > INPUTS:
        return model
    change = np.where(np.isfinite(problem.du_max), problem.du_max, 0.0)
    late = 0.5 * change / np.maximum(change, problem.deceleration)
    if late.max() < PROMPT or not problem.wheels.turns_on_the_spot:
        return model
    speed, turn = ((1.0 - share, share) for share in late.tolist())
    return replace(model, dictionary=ResponseDictionary(model.dictionary, speed, turn))


def within_ramps(problem: NavigationProblem, ramps: Ramps) -> NavigationProblem:
    """Return a problem whose robot is asked for no faster changes than its ramps allow.

    What is braked at may be less than what it speeds up at; changes away from zero are limited by
    either then.
    """
    if not ramps.limit:
        return problem
    wheels, fastest = problem.wheels.ramped(np.minimum(*ramps))
    _, slower = wheels.ramped(ramps[1])
    return replace(
        problem,
        wheels=wheels,
        du_max=np.minimum(problem.du_max, fastest),
        deceleration=np.minimum(problem.deceleration, slower),
    )


def check_motion(model: KoopmanModel, problem: NavigationProblem) -> None:
    """Refuse a model by which the robot does not follow its commands."""
    held = _fastest_commands(problem)
    history = np.repeat(held[:, None], model.history, axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        ends = model.predict(np.zeros((2, STATES)), held, history)
    followed = np.array((np.hypot(ends[0, 0], ends[0, 1]), abs(ends[1, 2]))) / model.dt
    for (name, unit), value, told in zip(AXES, followed, abs(reached_speeds(problem)), strict=True):
        if not value >= FOLLOWED * told:  # NaN, too
            raise ProblemError(
                f"model: at a {name} of {told:.2g} {unit} it moves by {value:.2g} {unit}, and "
                "the robot would stand: learn it from a log in which it moves as it is commanded"
            )


def reached_speeds(problem: NavigationProblem) -> Array:
    """Speed and turn rate (2,), each alone, in the direction in which the bounds allow more."""
    drives, turns = _fastest_commands(problem)
    return np.array((drives[0], turns[-1]))


def _fastest_commands(problem: NavigationProblem) -> Array:
    """Commands (2, m) by which the robot drives, and turns, in the faster direction of either."""
    held = problem.held_commands
    drives = held[0] if held[0, 0] >= -held[1, 0] else held[1]
    turns = held[2] if held[2, -1] >= -held[3, -1] else held[3]
    return np.stack([drives, turns])


def _check_wheels(problem: NavigationProblem, least: Array) -> None:
    """Refuse wheels that let the robot hardly drive, or hardly turn."""
    reached = np.abs(reached_speeds(problem))
    if (reached < least).any():
        raise ProblemError(
            f"max_wheel_speed: {problem.max_wheel_speed:.2g} m/s lets the robot drive at "
            f"{reached[0]:.2g} m/s and turn at {reached[1]:.2g} rad/s only, and it would stand"
        )


def _check_sight(problem: NavigationProblem) -> None:
    """Refuse a sensor within whose range the robot cannot stop from any speed."""
    if problem.sensor_range is None:
        return
    slow = STARTED * fastest(problem)[0]
    needed = slow * problem.dt + slow**2 / (2.0 * float(problem.deceleration[0]))
    if problem.sensor_range < needed:
        raise ProblemError(
            f"sensor_range: {problem.sensor_range:.2g} m is less than the {needed:.2g} m in which "
            f"the robot stops from {slow:.2g} m/s, and it would stand"
        )
