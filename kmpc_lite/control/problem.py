"""The optimal control problem's data: validated once, then trusted."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.input_checks import (
    OptionalValues,
    Values,
    check_bounds,
    check_track,
    given,
    positive,
    scalar,
    stages,
    vector,
    weight,
)
from kmpc_lite.control.wheels import Differential, Wheels, read_wheels
from kmpc_lite.errors import ProblemError
from kmpc_lite.scale import Scale
from kmpc_lite.types import STATES, Array

GOAL_Q, GOAL_R = (1.0, 5.0, 0.1), (0.5, 0.05)  # the paper's weights, of a goal that may be far away
UNIT_DECELERATION = np.array((1.0, 4.0))
"""Of the braking ramp of a robot that is its own unit [m/s^2, rad/s^2]."""
UNIT_SLACK_WEIGHTS = np.array((100.0, 1000.0))  # its slack weights [1/m, 1/m^2]


@dataclass(frozen=True, eq=False)
class NavigationProblem:
    """Drive to a pose within bounds and past obstacles (paper, eq. 9 to 11).

    The defaults are the paper's, but for the area: there is none unless it is given.

    ``min sum_{k=0}^{N-1} |x_k - x_ref|^2_Q + |u_k|^2_R + |u_k - u_{k-1}|^2_{R_change} + |x_N -
    x_ref|^2_{Q_terminal}``, u_{-1} being the command sent last, commands within bounds, position
    within the area, and every obstacle at least `robot_radius` + `margin` away from the robot's
    centre.

    Parameters
    ----------
    horizon : int
        Stages N.
    dt : float
        Period [s].
    Q, R : array_like, optional
        Weights of state (3,) and command (2,), or full positive semidefinite matrices. With
        guidance the state's weigh the distance from the guided reference. If not given they are
        the default of the controller's mode (`kmpc_lite.control.knowledge`): without guidance the
        paper's.
    R_change : array_like, optional
        Weight (2,), or a matrix, of a command's change from period to period [1/(m/s)^2,
        1/(rad/s)^2]. If not given it follows from bounds and period with guidance
        (`kmpc_lite.control.knowledge`), and is zero without, as in the paper.
    Q_terminal : array_like, optional
        Weight of the last state. With guidance it counts by the share of the plan that is at the
        goal; if not given it follows from Q and how fast the robot turns. Without guidance it
        is zero if not given, as in the paper.
    u_min, u_max : array_like
        Command bounds (2,) [m/s, rad/s]; they contain zero, since braking must be allowed.
    x_min, x_max : array_like
        Area of the robot's centre (3,) [m, m, rad], kept softly; the heading must be free. Infinite
        by default: the robot may go everywhere.
    robot_radius : float
        [m]; with a footprint it follows from that: of the circle about the pose that holds it.
    margin : float
        Distance to obstacles beyond the radii [m]; the paper has none.
    deceleration : array_like, optional
        How fast the braking ramp ends a command (2,) [m/s^2, rad/s^2]. If not given it follows
        size and speed (1 m/s^2, 4 rad/s^2 at 0.15 m and 0.6 m/s), or is `du_max` if that is more.
    du_max : array_like
        How fast commands may change (2,) [m/s^2, rad/s^2], no more than `deceleration` where that
        is given, too; else infinite if not given, as in the paper. Speeds that shrink in an
        emergency may do so at `deceleration`.
    track, max_wheel_speed : float
        Distance between the wheels [m] and how fast one turns at its rim [m/s], for robots whose
        wheels saturate together: ``|v| + track / 2 |omega| <= max_wheel_speed``. Infinite if not
        given: the command bounds alone.
    sensor_range : float, optional
        How far from the robot's edge all obstacles are told [m]: the robot stays able to stop
        within. If not given, all of them are told always; a `LaserScan` has its own reach.
    goal_tolerance : array_like, optional
        How near to its goal a robot has arrived, and stays (2,) [m, rad]. If not given, a tenth
        of its radius and 0.05 rad. Both grow with the noise of the poses that the model knows of.
    footprint : Footprint, optional
        What the robot covers on the floor, where that is no circle about its pose.
    wheels : Differential, Car or Omni
        What the wheels let the robot do: a car turns by ``|omega| <= |v| / turning_radius`` only.
    slack_weights : array_like, optional
        Weights (2,) of the linear [1/m] and the quadratic [1/m^2] penalty on entering an obstacle
        or leaving the area. If not given, 100 and 1000 for a robot of 0.15 m, less for larger
        ones. The penalty is exact while the linear weight exceeds the constraint's
        multiplier.

    Raises
    ------
    ProblemError
        Names the field that is wrong.
    """

    horizon: int = 20
    dt: float = 0.1
    Q: OptionalValues = given(None)
    R: OptionalValues = given(None)
    R_change: OptionalValues = given(None)
    Q_terminal: OptionalValues = given(None)
    u_min: Values = given((-0.6, -np.pi / 4))
    u_max: Values = given((0.6, np.pi / 4))
    x_min: Values = given((-np.inf, -np.inf, -np.inf))
    x_max: Values = given((np.inf, np.inf, np.inf))
    robot_radius: float = 0.15
    margin: float = 0.0
    deceleration: Values = given(None)
    du_max: Values = given((np.inf, np.inf))
    slack_weights: Values = given(None)
    track: float = 0.0
    max_wheel_speed: float = np.inf
    sensor_range: float | None = None
    goal_tolerance: OptionalValues = given(None)
    footprint: Footprint | None = None
    wheels: Wheels = Differential()

    def __post_init__(self) -> None:
        stages(self.horizon)
        self._take_footprint()
        object.__setattr__(self, "wheels", read_wheels(self.wheels))
        for name in ("dt", "robot_radius", "margin", "track"):
            scalar(name, getattr(self, name), above_zero=name == "dt")
        if self.sensor_range is not None:
            scalar("sensor_range", self.sensor_range, above_zero=True)
        check_track(self.track, self.max_wheel_speed)

        set_field = partial(object.__setattr__, self)
        inputs = self.wheels.inputs
        sizes = {"Q": STATES, "R": inputs, "R_change": inputs, "Q_terminal": STATES}
        for name, length in sizes.items():
            if (value := getattr(self, name)) is not None:
                set_field(name, weight(name, value, length))
        brakes_so = self.deceleration is not None and self.du_max is type(self).du_max
        for name in ("u_min", "u_max", "du_max"):
            set_field(name, vector(name, self._by_axis(name), inputs))
        for name in ("x_min", "x_max"):
            set_field(name, vector(name, getattr(self, name), STATES))
        if not (self.du_max > 0).all():
            raise ProblemError(f"du_max: expected numbers > 0, or infinity, got {self.du_max}")
        check_bounds(*self.bounds, self.robot_radius)
        if not self.wheels.reverse:
            set_field("u_min", np.maximum(self.u_min, (0.0, -np.inf)))
        # these follow the robot's size and speed where they are not given
        scale, changes = self.scale, np.where(np.isfinite(self.du_max), self.du_max, 0.0)
        brakes = UNIT_DECELERATION[list(self.wheels.axes)] * scale.acceleration
        follows = {
            "deceleration": np.maximum(brakes, changes),
            "slack_weights": UNIT_SLACK_WEIGHTS / (scale.length, scale.length**2),
        }
        for name, usual in follows.items():
            value = getattr(self, name)
            set_field(name, positive(name, usual if value is None else value, len(usual)))
        if brakes_so:
            set_field("du_max", self.deceleration.copy())
        if self.goal_tolerance is not None:
            set_field("goal_tolerance", positive("goal_tolerance", self.goal_tolerance, 2))

    def _by_axis(self, name: str) -> Any:
        """Field of one number for each of a command's; the default has speed and turn rate."""
        value = getattr(self, name)
        usual = value is getattr(type(self), name)
        return np.array(value)[list(self.wheels.axes)] if usual else value

    def _take_footprint(self) -> None:
        """Take the radius from the footprint, where there is one."""
        if self.footprint is None:
            return
        if not isinstance(self.footprint, Footprint):
            raise ProblemError(f"footprint: expected a Footprint, got {self.footprint!r:.80}")
        radius, given = self.footprint.radius, self.robot_radius
        if given != type(self).robot_radius and not np.isclose(given, radius, rtol=1e-6):
            raise ProblemError(
                f"robot_radius: follows from the footprint, {radius:g} m; leave it out, "
                f"got {given!r}"
            )
        object.__setattr__(self, "robot_radius", radius)

    @property
    def limits_wheels(self) -> bool:
        """Whether the wheels limit speed and turn rate together."""
        return math.isfinite(self.max_wheel_speed)

    @property
    def held_commands(self) -> Array:
        """Commands (4, m) by which the robot drives ahead, back, and turns left and right."""
        held = np.zeros((4, len(self.u_min)))
        held[0, 0], held[1, 0] = self.u_max[0], self.u_min[0]
        held[2, -1], held[3, -1] = self.u_max[-1], self.u_min[-1]
        if not self.wheels.turns_on_the_spot:
            held[2:, 0] = self.u_max[0] if self.u_max[0] > 0.0 else self.u_min[0]
        return self.within_bounds(held)

    def within_bounds(self, commands: Array) -> Array:
        """Bring commands (..., 2) within the command bounds; what wheels cannot do keeps its curve.

        Examples
        --------
        >>> problem = NavigationProblem(track=0.4, max_wheel_speed=0.6)
        >>> problem.within_bounds(np.array((0.6, 9.0))).round(3)
        array([0.476, 0.622])
        """
        # half the time of np.clip
        inside: Array = np.minimum(np.maximum(commands, self.u_min), self.u_max)
        if self.limits_wheels:
            faster = np.abs(inside[..., 0]) + 0.5 * self.track * np.abs(inside[..., -1])
            share = self.max_wheel_speed / np.maximum(faster, self.max_wheel_speed)
            inside = inside * share[..., None]
        return self.wheels.within(inside)

    @property
    def scale(self) -> Scale:
        """Units of the robot, from its radius and its fastest speed."""
        fastest = float(np.maximum(self.u_max, -self.u_min)[:-1].max())
        return Scale.of_robot(float(self.body_radius), fastest, self.wheels.inputs)

    @property
    def body_radius(self) -> float:
        """Radius of what is kept off obstacles: the robot's, or that of its footprint's circles."""
        return self.robot_radius if self.footprint is None else self.footprint.circle_radius

    @property
    def half_width(self) -> float:
        """How far the robot reaches aside of the line on which it drives ahead [m]."""
        return self.robot_radius if self.footprint is None else self.footprint.half_width

    @property
    def inflation(self) -> float:
        """How near the robot's middle may come to an obstacle that it drives past [m]."""
        return self.half_width + self.margin

    @property
    def bounds(self) -> tuple[Array, Array, Array, Array]:
        """u_min (2,), u_max (2,), x_min (3,), x_max (3,)."""
        return self.u_min, self.u_max, self.x_min, self.x_max

    @property
    def weights(self) -> tuple[Array, Array, Array]:
        """Q (3, 3), R (2, 2), Q_terminal (3, 3): the paper's if not given."""
        return (
            np.diag(GOAL_Q) if self.Q is None else self.Q,
            np.diag(np.array(GOAL_R)[list(self.wheels.axes)]) if self.R is None else self.R,
            np.zeros((STATES, STATES)) if self.Q_terminal is None else self.Q_terminal,
        )

    @property
    def change_weight(self) -> Array:
        """R_change (2, 2); zero, as in the paper, if not given."""
        return np.zeros((len(self.u_min),) * 2) if self.R_change is None else self.R_change

    def with_wheels(self, wheels: Wheels) -> NavigationProblem:
        """The same for a robot on other wheels: an omni's limits sideways are those ahead."""
        if wheels.inputs == self.wheels.inputs:
            return replace(self, wheels=wheels)
        limits = ("u_min", "u_max", "du_max", "deceleration")
        told = {name: getattr(self, name)[list(wheels.axes)] for name in limits}
        return replace(self, wheels=wheels, R=None, R_change=None, **told)

    @property
    def limits_changes(self) -> bool:
        """Whether `du_max` limits anything."""
        return bool(np.isfinite(self.du_max).any())

    def cost(
        self,
        states: Array,
        inputs: Array,
        reference: Array,
        terminal_share: float = 1.0,
        last: Array | None = None,
    ) -> float:
        """Objective of a plan without penalties.

        Parameters
        ----------
        states, inputs : ndarray
            (N + 1, 3) and (N, 2).
        reference : ndarray
            (3,) or (N + 1, 3).
        terminal_share : float
            Part of `Q_terminal` that counts.
        last : ndarray, optional
            Command (2,) sent last; zero if not given.
        """
        before = np.zeros((1, inputs.shape[1])) if last is None else np.reshape(last, (1, -1))
        changes = np.diff(inputs, axis=0, prepend=before)
        q, r, q_terminal = self.weights
        error = states - reference
        on_way, end = error[:-1], error[-1]
        return float(
            np.vdot(on_way @ q, on_way)
            + np.vdot(inputs @ r, inputs)
            + np.vdot(changes @ self.change_weight, changes)
            + terminal_share * (end @ q_terminal @ end)
        )
