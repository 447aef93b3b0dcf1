"""A way to a stop for every plan: none is driven unless the robot can still stop clear of everything after its coming command.

The tail of a plan is the coming command, as few further commands of the plan as possible, and a
brake: the ramp of `NavigationProblem.deceleration`, or zero at once for a model without input
history, whose robot stands when it is told to. A model with input history coasts through its past
commands. Where no tail of the plan is clear, its coming command is shrunk; where that does not help
either, the plan is not accepted, and the tail of the one before is driven.

Clear means: up to the stop, no obstacle comes nearer than the margin of the coming step, or than a
part of the room that a standing robot would have had (`SPEND`). So standing is always allowed, a
robot that is near an obstacle can pass by, and one that touches can get free.

It holds as far as these are true:

- the model is wrong about the way to the stop by less than the margin of the coming step
  (`Tightening.step_margin`);
- circles keep their velocity and solids stay until the robot stands; a standing robot can still be
  driven into;
- the pose is right, and every obstacle that the tail comes to is known;
- a robot whose model has no input history, and whose commands may change as they like (no
  `du_max`), stops within the period in which it is told to;
- margins are on: without them (``tightening=None``, the paper) no plan is refused, and what is left
  is to brake.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kmpc_lite.control.margins.tightening import Tightening
from kmpc_lite.control.nmpc.sqp import Trajectory
from kmpc_lite.control.obstacles.circles import circle_distances, stand_ins
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, STATES, Array

if TYPE_CHECKING:
    from kmpc_lite.control.obstacles.solids import Nearby

HARDLY = 0.05
"""Share of a speed that is hardly driving any more: turning in full instead moves the robot by a
fraction of a mm."""
FURTHER_TIME = 0.5
"""How much of the plan's rest is tried before the brake [s]."""
SHARES = (0.5, 0.25, 0.0)
"""Shares of the coming command that are tried where the whole one has no tail."""
SPEND = 0.25
"""Share of the room that a tail may use up where there is less of it than the margin."""
FASTER = 1.25
"""How much farther than its command says a robot is taken to drive where nothing is looked at more
closely."""
QUICK = (0.005, 0.05)
"""What the quick look at a robot that lags is taken to be wrong by [m], and as a share of the
way."""
ANSWERS = ((0, 0), (1, 0), (2, 1))
"""Row and column of the model's derivative by a command: driven ahead and aside by the speed,
turned by the turning speed."""
LONGEST_RAMP = 100
"""Periods of a braking ramp, at the most."""


class StopTrajectory(NamedTuple):
    """What follows the coming command."""

    further: int = 0
    """Commands of the plan after the coming one."""
    at_once: bool = False
    """Whether the brake is zero at once, not the ramp."""
    slowed: bool = False
    """Whether the plan's coming command was shrunk, and the plan rolled out anew."""

    def commands(self, inputs: Array, ramp_step: Array) -> Array:
        """Commands (T, 2) from the coming one to zero, of a plan's inputs (N, 2)."""
        driven = inputs[: 1 + self.further]
        brake = np.zeros((1, 2)) if self.at_once else ramp(driven[-1], ramp_step)
        return np.concatenate([driven, brake])


class StopTrajectories:
    """Finds the tail of a plan.

    Parameters
    ----------
    problem : NavigationProblem
        Period, horizon, radius and deceleration.
    tightening : Tightening, optional
        Margins; without them every plan is accepted.
    """

    def __init__(self, problem: NavigationProblem, tightening: Tightening | None) -> None:
        self._dt, self._touch, self._tightening = problem.dt, problem.robot_radius, tightening
        self._ramp_step = np.asarray(problem.deceleration) * problem.dt
        self._slow_v, self._slow_omega = self._ramp_step.tolist()
        self._further = min(int(round(FURTHER_TIME / problem.dt)), problem.horizon - 1)
        self._limited, self._rates = problem.limits_changes, RateLimit(problem)
        self._known: KoopmanModel | None = None
        self._counts = np.arange(1.0, LONGEST_RAMP + 1)

    def find(
        self,
        model: KoopmanModel,
        plan: Trajectory,
        circles: Array,
        nearby: Nearby | None,
        solids: tuple[Array, Array, Array],
        past: Array,
        last: Array | None = None,
    ) -> StopTrajectory | None:
        """Tail of a plan, whose coming command is shrunk where it must be; None where there is no way to a stop.

        Parameters
        ----------
        model : KoopmanModel
            Predicts.
        plan : Trajectory
            From the present pose; changed in place where its command is shrunk.
        circles : ndarray
            (M, 5), as they are now.
        nearby : Nearby, optional
            Solids that the robot can come to.
        solids : tuple of ndarray
            A point near the robot (2,), the distances of these solids from it (C,), and the normals
            there (C, 2): a half-plane that a convex solid lies behind is as good as any other.
        past : ndarray
            (L, 2) commands already sent.
        last : ndarray, optional
            (2,) the one sent last: where changes are limited, the coming one is shrunk only as far
            from it as is allowed.
        """
        tightening = self._tightening
        if tightening is None or not (len(circles) or nearby):
            return StopTrajectory()
        ahead, closing = circles, 0.0
        if circles[:, 3:].any():
            ahead = circles.copy()
            ahead[:, :2] += self._dt * circles[:, 3:]
            closing = float(np.abs(circles[:, 3:]).sum(axis=1).max())
        if nearby:
            ahead = np.concatenate([ahead, stand_ins(*solids)])
        here, command = plan.states[0], plan.inputs[0]
        share = tightening.speed_share(here, command, ahead, past)
        if share < 1.0:
            # where it may hardly drive it turns on the spot, which a round robot always may, or it
            # would stand there for ever
            self._shrink(model, plan, share, past)
            if self._limited and last is not None:
                plan.inputs[0] = self._rates.limit(plan.inputs[0], last)
                plan.states[:] = model.rollout(here, plan.inputs, past)
        v, omega = command.tolist()
        periods = max(abs(v) / self._slow_v, abs(omega) / self._slow_omega)
        speeds = abs(v) * (1.0 + 0.5 * periods)
        if model.history:
            speeds += float(np.abs(past[:, 0]).sum())
        margin = tightening.step_margin(v, omega)
        # far from everything, which is most of the time, nothing needs to be rolled out
        if (
            tightening.nearest
            > self._dt * (FASTER * speeds + closing * (periods + model.history + 1.0)) + margin
        ):
            return StopTrajectory(slowed=share < 1.0)
        if not (model.history or self._limited):
            # a robot without lag stands when it is told to, and the coming period was looked at
            # above
            return StopTrajectory(
                at_once=not self._ramp_is_clear(plan, ahead, periods, margin), slowed=share < 1.0
            )
        if self._lagging_ramp_is_clear(model, plan, ahead, margin, past):
            return StopTrajectory(slowed=share < 1.0)
        return self._search(model, plan, circles, nearby, past, share < 1.0)

    def rollout(self, model: KoopmanModel, here: Array, commands: Array, past: Array) -> Array:
        """States of a tail's commands (..., T, 2) and of the coasting after them, (..., T + L + 1, 3)."""
        if model.history:
            still = np.zeros((*commands.shape[:-2], model.history, 2))
            commands = np.concatenate([commands, still], axis=-2)
        return model.rollout(here, commands, past)

    def _shrink(self, model: KoopmanModel, plan: Trajectory, share: float, past: Array) -> None:
        plan.inputs[0] *= (share, share if share > HARDLY else 1.0)
        plan.states[:] = model.rollout(plan.states[0], plan.inputs, past)

    def _ramp_is_clear(self, plan: Trajectory, ahead: Array, periods: float, margin: float) -> bool:
        """Whether the ramp keeps the margin: without lag it is the arc of the coming period, driven on ever more slowly."""
        (x0, y0, before), (x1, y1, after) = plan.states[:2].tolist()
        k = self._counts[: min(math.ceil(periods), LONGEST_RAMP)]
        # how often the coming period's way is driven again up to each stage: 1 - 1/periods, 1 -
        # 2/periods, ...
        times = k * (1.0 - (k + 1.0) / (2.0 * max(periods, 1.0)))
        turned = 0.5 * (after - before) * (1.0 + times)
        cos, sin = times * np.cos(turned), times * np.sin(turned)
        dx, dy = x1 - x0, y1 - y0
        x, y = x1 + dx * cos - dy * sin, y1 + dx * sin + dy * cos
        return self._least_room(x, y, self._dt * k, ahead) >= margin

    def _least_room(self, x: Array, y: Array, times: Array, ahead: Array) -> float:
        """Room at places (T,) and times after the coming period (T,)."""
        x, y = x[:, None], y[:, None]
        if ahead[:, 3:].any():
            x, y = x - times[:, None] * ahead[:, 3], y - times[:, None] * ahead[:, 4]
        return (
            float((np.hypot(x - ahead[:, 0], y - ahead[:, 1]) - ahead[:, 2]).min(initial=np.inf))
            - self._touch
        )

    def _lagging_ramp_is_clear(
        self, model: KoopmanModel, plan: Trajectory, ahead: Array, margin: float, past: Array
    ) -> bool:
        """Whether the ramp and the coasting after it keep the margin and `QUICK`: the model's answer to commands, summed up at once.

        What it cannot tell is rolled out, at ten times the price.
        """
        if model is not self._known:
            lin = model.linearize(np.zeros(STATES), np.zeros(INPUTS))
            answer = np.concatenate([lin.B[None], lin.B_past])
            self._known, self._ahead, self._left, self._turned = (
                model,
                *(answer[:, row, column].copy() for row, column in ANSWERS),
            )
        commands = np.concatenate(
            [
                past,
                StopTrajectory().commands(plan.inputs, self._ramp_step),
                np.zeros((model.history, INPUTS)),
            ]
        )
        first, count = model.history, len(commands) - model.history
        speeds, turns = np.ascontiguousarray(commands[:, 0]), np.ascontiguousarray(commands[:, 1])
        driven = np.convolve(speeds, self._ahead)[first : first + count]
        aside = np.convolve(speeds, self._left)[first : first + count]
        turned = np.convolve(turns, self._turned)[first : first + count]
        x0, y0, heading = plan.states[0].tolist()
        headings = heading + np.cumsum(turned) - 0.5 * turned
        cos, sin = np.cos(headings), np.sin(headings)
        x, y = (
            x0 + np.cumsum(driven * cos - aside * sin),
            y0 + np.cumsum(driven * sin + aside * cos),
        )
        slack = QUICK[0] + QUICK[1] * float(np.abs(driven).sum())
        # also false for NaN
        return self._least_room(x, y, self._dt * np.arange(count), ahead) >= margin + slack

    def _search(
        self,
        model: KoopmanModel,
        plan: Trajectory,
        circles: Array,
        nearby: Nearby | None,
        past: Array,
        slowed: bool,
    ) -> StopTrajectory | None:
        """First tail of a robot that lags that is clear: of the whole command, then of shares of it."""
        whole = StopTrajectory(slowed=slowed).commands(plan.inputs, self._ramp_step)[None]
        if self._are_clear(model, plan.states[0], whole, circles, nearby, past)[0]:
            return StopTrajectory(slowed=slowed)
        tails = [
            StopTrajectory(further, slowed=slowed).commands(plan.inputs, self._ramp_step)
            for further in range(1, self._further + 1)
        ]
        # a command whose change is limited cannot be shrunk at will
        tails += [
            StopTrajectory().commands(share * plan.inputs[:1], self._ramp_step)
            for share in SHARES
            if not self._limited
        ]
        commands = np.zeros((len(tails), max(map(len, tails)), 2))
        for row, tail in zip(commands, tails, strict=True):
            row[: len(tail)] = tail
        clear = self._are_clear(model, plan.states[0], commands, circles, nearby, past)
        if not clear.any():
            return None
        first = int(clear.argmax())
        if first < self._further:
            return StopTrajectory(further=first + 1, slowed=slowed)
        plan.inputs[0] *= SHARES[first - self._further]
        plan.states[:] = model.rollout(plan.states[0], plan.inputs, past)
        return StopTrajectory(slowed=True)

    def _are_clear(
        self,
        model: KoopmanModel,
        here: Array,
        commands: Array,
        circles: Array,
        nearby: Nearby | None,
        past: Array,
    ) -> Array:
        """Which of the tails (C, T, 2) from a pose (3,) are clear, (C,)."""
        assert self._tightening is not None
        states = self.rollout(model, here, commands, past)[:, 1:]
        count, length = states.shape[:2]
        points = states[..., :2].reshape(-1, 2)
        times = np.tile(self._dt * np.arange(1, length + 1), count)
        rooms, standing = [], []
        if len(circles):
            rooms.append(circle_distances(circles, points, times)[0])
            standing.append(
                np.tile(
                    circle_distances(
                        circles, np.repeat(here[None, :2], length, axis=0), times[:length]
                    )[0],
                    (count, 1),
                )
            )
        if nearby:
            rooms.append(nearby.least(points)[:, None])
            standing.append(np.full((len(points), 1), nearby.least(here[None, :2])[0]))
        room, still = (
            np.concatenate(rooms, axis=1) - self._touch,
            np.concatenate(standing, axis=1) - self._touch,
        )
        margins = np.array(
            [self._tightening.step_margin(v, omega) for v, omega in commands[:, 0].tolist()]
        )
        needed = np.minimum(
            np.repeat(margins, length)[:, None], np.where(still > 0.0, (1.0 - SPEND) * still, still)
        )
        # also false for NaN
        clear: Array = (room >= needed - 1e-9).all(axis=1).reshape(count, length).all(axis=1)
        return clear


def ramp(command: Array, step: Array) -> Array:
    """Commands (T, 2) after one (2,) that is braked by at most `step` (2,) per period; the last is zero.

    Both speeds shrink by one factor, so that the robot keeps to the curve that it is on.
    """
    periods = float((np.abs(command) / step).max())
    count = max(1, min(math.ceil(periods - 1e-9), LONGEST_RAMP))
    shares = 1.0 - np.arange(1, count + 1) / max(periods, 1e-9)
    shares[-1] = 0.0
    commands: Array = shares[:, None] * command
    return commands
