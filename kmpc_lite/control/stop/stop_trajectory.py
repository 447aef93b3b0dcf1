"""Where a plan is checked for a stop: none is driven unless the robot can still stop clear.

The stop trajectory of a plan is the coming command, as few further commands of the plan as
possible, and a brake: the ramp of `NavigationProblem.deceleration`, or zero at once for a model
without input history, whose robot stands when it is told to. A model with input history coasts
through its past commands. Where no stop trajectory of the plan is clear, its coming command is
slowed; where that does not help either, the plan is not accepted, and the stop trajectory of the
one before is driven.

Clear means: up to the stop, no obstacle comes nearer than the margin of what is driven, or than the
clearance that a standing robot would have had, less a share of what the pose's noise leaves sure of
it (`StopOptions.spend_share`). So standing is always allowed, a robot that is near an obstacle can
pass by, and one that touches can get free. What drives on before it brakes has no such leave.

It holds as far as these are true:

- the model is wrong about the stop trajectory by less than its margins: `stop_margins` of the
  `CommandCheck`; for a robot that stops within its period `step_margin`, of the coming command;
- circles keep their velocity, or turn on the spot (`passers_by`), and solids stay until the robot
  stands; a standing robot can still be driven into;
- the pose is right, and every obstacle that the stop trajectory comes to is known: all are told,
  or those within `NavigationProblem.sensor_range`, or a scan has shown the place to be free;
- a robot whose model has no input history, and whose commands may change as they like (no
  `du_max`), stops within the period in which it is told to;
- margins are on: without them (``tightening=None``, the paper) no plan is refused, and what is left
  is to brake.
"""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.footprint import places_of
from kmpc_lite.control.kernels.clearance import (
    PLACE,
    SPREAD,
    VELOCITY,
    distances,
    some_move,
    some_spread,
)
from kmpc_lite.control.margins.command_check import CommandCheck
from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.options import StopOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.control.stop.braking import ROUNDING, Braking
from kmpc_lite.control.stop.passers_by import PassersBy
from kmpc_lite.control.stop.quick_look import QuickLook
from kmpc_lite.control.stop.stop_task import CheckedPlan, StopTask, StopTrajectory
from kmpc_lite.control.world.circles import stand_ins
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import STATES, Array


class StopTrajectories:
    """Finds the stop trajectory of a plan.

    Parameters
    ----------
    problem : NavigationProblem
        Period, horizon, radius and deceleration.
    options : StopOptions, optional
        What is tried, and what is clear.
    emerging_speed : float
        At which something may come out of what is not known [m/s].
    """

    def __init__(
        self,
        problem: NavigationProblem,
        options: StopOptions | None = None,
        emerging_speed: float = 0.0,
    ) -> None:
        self._options = options = StopOptions() if options is None else options
        self._dt, self._radius = problem.dt, problem.body_radius
        self._footprint = problem.footprint
        self._braking = Braking(problem, options)
        self._quick_look = QuickLook(problem, self._braking, options)
        self._passers_by = PassersBy(problem, self._braking, options)
        self._further = min(round(options.further_time / problem.dt), problem.horizon - 1)
        self._rates = RateLimit(problem)
        known = problem.sensor_range
        self._known, self._emerging = math.inf if known is None else known, emerging_speed

    def find(self, states: Array, inputs: Array, task: StopTask) -> CheckedPlan:
        """Check a plan from the present pose; its coming command is slowed where it must be.

        Parameters
        ----------
        states, inputs : ndarray
            The plan (N + 1, 3) and (N, 2); left as they are.
        task : StopTask
            What it must be clear of.
        """
        check, drift = task.check, task.drift
        something = len(task.things) or task.nearby or self._known < math.inf or len(task.perhaps)
        if check is None or drift is None or not something:
            return CheckedPlan(StopTrajectory(), states, inputs)
        ahead, closing = self._ahead(task)
        model, here = task.model, states[0]
        share, nearest = check.speed_share(drift, here, inputs[0], ahead, task.past)
        if closing or len(task.perhaps):
            # to keep away from who only seems to walk costs little: he has stood there anyway
            beside = self._passers_by.share(*task.walking, states, inputs[0], model.history)
            share = min(share, beside)
        plan = CheckedPlan(StopTrajectory(), states, inputs)
        if share < 1.0:
            turn_share = check.turn_share(drift, nearest, float(inputs[0, 1]))
            plan = self._slowed(plan, share, turn_share, task)
        v, omega = plan.inputs[0].tolist()
        periods = self._braking.periods(v, omega)
        distance = self._braking.distance(v, periods)
        if model.history:
            distance += self._dt * float(np.abs(task.past[:, 0]).sum())
        distance += self._swing(omega, periods, task)
        lags = model.history or self._rates.active
        if lags:
            turned = self._dt * (abs(omega) * (1.0 + periods) + np.abs(task.past[:, 1]).sum())
            margin = float(check.stop_margins(drift, np.array([distance]), np.array([turned]))[0])
        else:
            margin = check.step_margin(drift, v, omega)
        # far from everything, which is most of the time, nothing needs to be rolled out
        approach = self._dt * closing * (periods + model.history + 1.0)
        farthest = self._options.overspeed * distance + margin
        emerging = self._dt * self._emerging * (periods + model.history + 1.0)
        in_sight = farthest + emerging <= self._known
        if in_sight and nearest > farthest + approach:
            return plan
        if not lags:
            # a robot without lag stands when it is told to, and the coming period was checked above
            plan = plan if in_sight else self._within_sight(plan, margin, task)
            clear = in_sight and self._ramp_is_clear(plan, periods, ahead, margin, task)
            return plan._replace(stop=StopTrajectory(at_once=not clear))
        if in_sight and self._lagging_ramp_is_clear(plan, ahead, margin, task):
            return plan
        return self._search(plan, task, check, drift)

    def rollout(self, model: MotionModel, here: Array, commands: Array, past: Array) -> Array:
        """States of a stop trajectory and of the coasting after it.

        Parameters
        ----------
        model : MotionModel
            Predicts.
        here : ndarray
            Pose (3,) at which it begins.
        commands : ndarray
            (..., T, 2), to zero.
        past : ndarray
            (L, 2) commands already sent.

        Returns
        -------
        ndarray
            (..., T + L + 1, 3).
        """
        if model.history:
            still = np.zeros((*commands.shape[:-2], model.history, 2))
            commands = np.concatenate([commands, still], axis=-2)
        return model.rollout(here, commands, past)

    def _ahead(self, task: StopTask) -> tuple[Array, float]:
        """Circles and stand-ins for solids at the end of the coming period, and their speed."""
        ahead, closing = task.things, 0.0
        if some_move(ahead):
            closing = float(np.abs(ahead[:, VELOCITY]).sum(axis=1).max())
            ahead = ahead.copy()
            ahead[:, PLACE] += self._dt * ahead[:, VELOCITY]
        if some_spread(ahead):
            # how fast it may walk is looked at by itself (`passers_by`)
            ahead = ahead.copy()
            ahead[:, SPREAD] = 0.0
        if task.nearby:
            ahead = np.concatenate([ahead, stand_ins(*task.solids_ahead)])
        return ahead, closing

    def _swing(self, omega: float, periods: float, task: StopTask) -> float:
        """How far turning moves what is kept off obstacles, down a ramp [m]: a round robot none."""
        return 0.0

    def _ramp_is_clear(
        self, plan: CheckedPlan, periods: float, ahead: Array, margin: float, task: StopTask
    ) -> bool:
        """Whether the ramp of a robot without lag keeps a margin [m]."""
        return self._quick_look.ramp_is_clear(plan.states, periods, ahead, margin)

    def _lagging_ramp_is_clear(
        self, plan: CheckedPlan, ahead: Array, margin: float, task: StopTask
    ) -> bool:
        """Whether the ramp of a robot that lags keeps a margin [m], as a quick look tells."""
        return self._quick_look.lagging_ramp_is_clear(
            task.model, plan.states, plan.inputs[0], task.past, ahead, margin
        )

    def _slowed(
        self, plan: CheckedPlan, share: float, turn_share: float, task: StopTask
    ) -> CheckedPlan:
        """Slow the coming command, and roll the plan out anew."""
        inputs = plan.inputs.copy()
        # where it may hardly drive it turns on the spot, which moves a round robot by its noise
        turns = share <= self._options.turn_only_share and self._footprint is None
        inputs[0] *= (share, max(share, turn_share) if turns else share)
        if self._rates.active:
            inputs[0] = self._rates.limit(inputs[0], task.last)
        states = task.model.rollout(plan.states[0], inputs, task.past)
        return CheckedPlan(plan.stop, states, inputs, slowed=True)

    def _within_sight(self, plan: CheckedPlan, margin: float, task: StopTask) -> CheckedPlan:
        """Slow the command of a robot without lag until the coming period ends in what is known."""
        allowed = max(self._known - margin - self._dt * self._emerging, 0.0)
        v, omega = plan.inputs[0].tolist()
        driven = self._dt * abs(v) + self._swing(omega, 0.0, task)
        return plan if driven <= allowed else self._slowed(plan, allowed / driven, 1.0, task)

    def _search(
        self, plan: CheckedPlan, task: StopTask, check: CommandCheck, drift: DriftState
    ) -> CheckedPlan:
        """Find the first clear stop trajectory of a robot that lags, of the whole command first."""
        here, inputs, braking = plan.states[0], plan.inputs, self._braking
        whole = StopTrajectory().commands(inputs, braking)[None]
        if self._are_clear(here, whole, task, check, drift)[0]:
            return plan
        candidates = [
            StopTrajectory(further).commands(inputs, braking)
            for further in range(1, self._further + 1)
        ]
        # a command whose change is limited cannot be slowed at will
        shares = () if self._rates.active else self._options.slower_shares
        candidates += [StopTrajectory().commands(share * inputs[:1], braking) for share in shares]
        if not candidates:
            return plan._replace(stop=None)
        commands = np.zeros((len(candidates), max(map(len, candidates)), 2))
        for row, candidate in zip(commands, candidates, strict=True):
            row[: len(candidate)] = candidate
        clear = self._are_clear(here, commands, task, check, drift, self._further)
        if not clear.any():
            return plan._replace(stop=None)
        first = int(clear.argmax())
        if first < self._further:
            return plan._replace(stop=StopTrajectory(further=first + 1))
        slower = inputs.copy()
        slower[0] *= shares[first - self._further]
        states = task.model.rollout(here, slower, task.past)
        return CheckedPlan(StopTrajectory(), states, slower, slowed=True)

    def _are_clear(
        self,
        here: Array,
        commands: Array,
        task: StopTask,
        check: CommandCheck,
        drift: DriftState,
        strictly: int = 0,
    ) -> Array:
        """Which of the stop trajectories (C, T, 2) from a pose (3,) are clear, (C,)."""
        states = self.rollout(task.model, here, commands, task.past)[:, 1:]
        count, length = states.shape[:2]
        # a round robot has one place to look at, another one has those of its circles
        points, places = places_of(self._footprint, states), places_of(self._footprint, here)
        each = len(places)
        times = np.repeat(np.tile(self._dt * np.arange(1, length + 1), count), each)
        gaps, standing = [], []
        if len(task.things):
            things = task.things.copy()
            things[:, SPREAD] = 0.0  # how fast it may walk is looked at by itself (`passers_by`)
            gaps.append(distances(things, points, times))
            still = np.tile(places, (length, 1))
            beside = distances(things, still, times[: length * each])
            standing.append(np.tile(beside, (count, 1)))
        if task.nearby:
            gaps.append(task.nearby.least(points)[:, None])
            standing.append(np.tile(task.nearby.least(places), count * length)[:, None])
        if self._known < math.inf:
            # as the distance from an obstacle all around that comes nearer
            away = points - np.tile(places, (count * length, 1))
            away = np.hypot(*away.T) + self._emerging * times
            gaps.append((self._known + self._radius - away)[:, None])
            still = self._known + self._radius - self._emerging * times
            standing.append(still[:, None])
        clearance = np.concatenate(gaps, axis=1) - self._radius
        still_clearance = np.concatenate(standing, axis=1) - self._radius
        margins = check.stop_margins(drift, *_moved(here, states)).reshape(-1).repeat(each)
        left = still_clearance - self._options.spend_share * check.sure(still_clearance)
        needed = np.minimum(margins[:, None], left)
        # the first ones keep their margins even where the robot has less: it need not drive on
        strict = slice(strictly * length * each)
        needed[strict] = margins[strict, None]
        # also false for NaN
        enough: Array = clearance >= needed - ROUNDING
        clear: Array = np.logical_and.reduce(enough.reshape(count, -1), axis=1)
        return clear


def _moved(here: Array, states: Array) -> tuple[Array, Array]:
    """Distances and turns of the periods of stop trajectories (C, T, 3) from a pose (3,)."""
    steps = np.diff(states, axis=1, prepend=np.broadcast_to(here, (len(states), 1, STATES)))
    return np.hypot(steps[..., 0], steps[..., 1]), steps[..., 2]


def stop_trajectories(
    problem: NavigationProblem, options: StopOptions, emerging_speed: float
) -> StopTrajectories:
    """What finds stop trajectories of a problem's robot; arguments as of `StopTrajectories`."""
    if problem.footprint is None:
        return StopTrajectories(problem, options, emerging_speed)
    # here, since most robots are round
    from kmpc_lite.control.stop.body_stop import BodyStopTrajectories

    return BodyStopTrajectories(problem, problem.footprint, options, emerging_speed)
