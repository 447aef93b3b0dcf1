"""Stop trajectories of a robot that is not round: turning moves it, too."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.options import StopOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.stop.stop_task import CheckedPlan, StopTask, StopTrajectory
from kmpc_lite.control.stop.stop_trajectory import StopTrajectories
from kmpc_lite.control.world.circles import stand_ins
from kmpc_lite.types import Array


class BodyStopTrajectories(StopTrajectories):
    """Finds stop trajectories on which all circles of a footprint stay clear.

    Parameters
    ----------
    problem : NavigationProblem
        Period, horizon, radius and deceleration.
    footprint : Footprint
        Its own.
    options : StopOptions
        What is tried, and what is clear.
    emerging_speed : float
        At which something may come out of what is not known [m/s].
    """

    def __init__(
        self,
        problem: NavigationProblem,
        footprint: Footprint,
        options: StopOptions,
        emerging_speed: float = 0.0,
    ) -> None:
        super().__init__(problem, options, emerging_speed)
        self._reach, self._circle_count = footprint.reach, len(footprint.circles)

    def _ahead(self, task: StopTask) -> tuple[Array, float]:
        """Circles and stand-ins (C, M, 5) for each circle of the robot, and their speed.

        A half-plane that keeps one end of the robot out of a solid may cut its other end.
        """
        ahead, closing = super()._ahead(_without_solids(task))
        ahead = np.repeat(ahead[None], self._circle_count, axis=0)
        if task.nearby:
            instead = [stand_ins(*seen) for seen in zip(*task.solids_ahead, strict=True)]
            ahead = np.concatenate([ahead, np.array(instead)], axis=1)
        return ahead, closing

    def _swing(self, omega: float, periods: float, task: StopTask) -> float:
        turned = abs(omega) * (1.0 + 0.5 * periods)
        if task.model.history:
            turned += float(np.abs(task.past[:, 1]).sum())
        return self._reach * self._dt * turned

    def _ramp_is_clear(
        self, plan: CheckedPlan, periods: float, ahead: Array, margin: float, task: StopTask
    ) -> bool:
        if task.check is None or task.drift is None:
            return False
        commands = StopTrajectory().commands(plan.inputs, self._braking)[None]
        return bool(self._are_clear(plan.states[0], commands, task, task.check, task.drift)[0])

    def _lagging_ramp_is_clear(
        self, plan: CheckedPlan, ahead: Array, margin: float, task: StopTask
    ) -> bool:
        return False  # the whole stop trajectory is rolled out


def _without_solids(task: StopTask) -> StopTask:
    """The same with circles alone."""
    return StopTask(task.model, task.past, task.last, task.things)
