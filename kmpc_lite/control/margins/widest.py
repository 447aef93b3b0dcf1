"""The margin that no plan within the command bounds exceeds: kept if that is no hindrance."""

from __future__ import annotations

import math

from kmpc_lite.control.margins.model_noise import HEADING, InflatedNoise, ModelNoise, trace
from kmpc_lite.control.options import fastest
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.tube import MEMORY, TURN


class Widest:
    """Adds up all that a margin consists of.

    `noise`: of the model. `problem`: outline and command bounds. `headway`, `solver_margin`: least
    margin at the fastest speed, and what is added to every margin [m].
    """

    def __init__(
        self, noise: ModelNoise, problem: NavigationProblem, headway: float, solver_margin: float
    ) -> None:
        self._noise, self._headway, self._solver_margin = noise, headway, solver_margin
        self.reach = 0.0 if problem.footprint is None else problem.footprint.reach
        """How far what is kept off obstacles lies from the pose: turning moves it [m]."""
        self._fastest = v, omega = fastest(problem)
        pose = noise.tube.pose + v**2 * noise.tube.pose_by_speed
        self.pose_variance = float(pose[0, 0] + pose[1, 1])
        """Of a measured position, at full speed, both axes together [m^2]."""
        self._heading_variance = float(pose[2, 2])
        # for how many periods each heading error leads aside: sum of the squares, and sum
        aside = [min(k, noise.delay + 1.0 / TURN) for k in range(1, MEMORY + noise.delay + 1)]
        self._heading_periods = sum(a * a for a in aside), sum(aside)
        # what a period at full speed, driving and turning, cuts off
        radius, dt = float(problem.body_radius), noise.dt
        travel = v * dt + self.reach * omega * dt
        self._chord = math.hypot(radius + travel * omega * dt / 8, travel / 2) - radius

    def of(self, found: InflatedNoise) -> float:
        """Add up all noise at full speed, taken back by nothing but time."""
        v, omega = self._fastest
        noise, plan, lasting = self._noise, found.plan, found.lasting
        travel, periods = v * noise.dt, MEMORY + noise.delay
        squares, whole = self._heading_periods
        by_speed, by_turn_rate = trace(plan)
        turned = plan.item(0, HEADING) * v * v + plan.item(1, HEADING) * omega * omega
        turn_variance = periods * turned + self._heading_variance
        variance = (
            periods * (v * v * by_speed + omega * omega * by_turn_rate)
            + travel * travel * turned * squares
            + self.pose_variance
        )
        if noise.lasts:
            by_speed, by_turn_rate = trace(lasting)
            turned = lasting.item(0, HEADING) * v * v + lasting.item(1, HEADING) * omega * omega
            variance += periods**2 * (v * v * by_speed + omega * omega * by_turn_rate)
            variance += travel * travel * turned * whole**2
            turn_variance += periods**2 * turned
        deviation = math.sqrt(variance)
        if self.reach:
            deviation += self.reach * math.sqrt(turn_variance)
        widest = max(noise.quantile * deviation, self._headway)
        return widest + self._chord + self._solver_margin
