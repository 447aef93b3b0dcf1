"""A problem in the robot's own units; see `kmpc_lite.scale`."""

from __future__ import annotations

from dataclasses import replace

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array


def scaled_problem(problem: NavigationProblem, scale: Scale) -> NavigationProblem:
    """Give the same problem in units: weights too, so that its solution is the same.

    Weights that the user left out stay left out: their defaults are told in units.
    """
    if scale.is_one:
        return problem
    state, command = scale.state, scale.command

    def weight(value: Array | None, factors: Array) -> Array | None:
        return None if value is None else value * factors * factors[:, None]

    slack, near = problem.slack_weights, problem.goal_tolerance
    return replace(
        problem,
        dt=problem.dt / scale.time,
        Q=weight(problem.Q, state),
        R=weight(problem.R, command),
        Q_terminal=weight(problem.Q_terminal, state),
        u_min=problem.u_min / command,
        u_max=problem.u_max / command,
        x_min=problem.x_min / state,
        x_max=problem.x_max / state,
        robot_radius=problem.robot_radius / scale.length,
        footprint=None if problem.footprint is None else problem.footprint.scaled(scale.length),
        margin=problem.margin / scale.length,
        deceleration=problem.deceleration / scale.acceleration,
        du_max=problem.du_max / scale.acceleration,
        slack_weights=slack * (scale.length, scale.length**2),
        track=problem.track / scale.length,
        sensor_range=None if problem.sensor_range is None else problem.sensor_range / scale.length,
        goal_tolerance=None if near is None else near / state[1:],
        max_wheel_speed=problem.max_wheel_speed / scale.speed,
        wheels=problem.wheels.in_units(scale),
    )
