"""Options of the solver: how a QP is solved, how many passes are made, and when they end."""

from __future__ import annotations

import math
from dataclasses import dataclass

from kmpc_lite.option_fields import (
    angle,
    check,
    clock_seconds,
    count,
    group,
    part,
    radii,
    share,
    switch,
)


@dataclass(frozen=True, slots=True)
class OSQPOptions:
    """Settings of OSQP for one kind of QP, under OSQP's own names."""

    tolerance: float = share(1e-3, zero=False)
    """`eps_abs` and `eps_rel`. The plan is checked by the model after the QP, and corrected in the
    next period."""
    max_iter: int = count(60)
    """What is not solved by then is near enough: later iterations change the command little."""
    rho: float = share(1.0, zero=False)
    """Step size of ADMM, on rows that are scaled to suit it."""
    alpha: float = share(1.4, zero=False)
    """Over-relaxation of ADMM."""
    adaptive_rho: bool = switch(False)
    """Whether `rho` is adapted in a solve. Without that, all solves take nearly the same time."""
    adaptive_rho_interval: int = count(50)
    """Iterations between two adaptations."""
    scaling: int = count(0, least=0)
    """Rounds of scaling. None: the rows are scaled by `SolverOptions`, once for all QPs."""
    check_termination: int = count(10)
    """Iterations between two looks at the residuals."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class SolverOptions:
    """How the nonlinear program is solved."""

    real_time: OSQPOptions = group(OSQPOptions())
    """For one pass a period."""
    lagging: OSQPOptions = group(
        OSQPOptions(max_iter=300, adaptive_rho=True, adaptive_rho_interval=60)
    )
    """The same for a model with input history, whose QPs need more iterations near obstacles: what
    the robot still does of past commands it cannot take back, and the multipliers become large."""
    converged: OSQPOptions = group(
        OSQPOptions(
            tolerance=1e-7,
            max_iter=4000,
            alpha=1.6,
            adaptive_rho=True,
            scaling=10,
            check_termination=25,
        )
    )
    """For passes to convergence, whose steps become as small as the tolerance of the passes."""
    half_plane_scale: float = share(4.0, zero=False)
    """Factor of the rows of half-planes: their multipliers are large, and settle in fewer
    iterations of ADMM where they are scaled down."""
    slack_scale: float = share(8.0, zero=False)
    """The same of the rows that keep slacks from being negative."""

    real_time_turn: float = angle(0.6, zero=False)
    """Largest turn in a period [rad] that one pass a period keeps up with: the plan of the period
    before is no linearisation to begin with where it has turned farther ..."""
    long_period_passes: int = count(10)
    """... and so many passes are made; there is time for them in such a period."""
    long_step: float = radii(3.0, zero=False)
    """Where a robot that makes so many passes can drive farther than this in a period [radii], its
    ways between the stages are kept out of circles, too: it could leap over one that it meets."""
    cold_passes: int = count(10)
    """Most passes of a step that has no warm start: the first linearisation, at rest, does not see
    that steering has an effect."""
    new_path_passes: int = count(2)
    """Most passes of a step that begins along a new path."""
    contradicted_passes: int = count(4)
    """Most passes of a step whose plan the model contradicts after the first, by more than
    `StepOptions.accepted_defect`."""
    cold_tolerance: float = share(0.02, zero=False)
    """Change of the trajectory that ends these passes [m, rad, m/s, rad/s]."""
    lost_position: float = radii(10 / 3, zero=False)
    """A pose farther from the predicted one [radii] makes the last plan worthless as a start."""
    lost_heading: float = angle(1.0, zero=False)
    """The same of the heading [rad]."""

    short_step: float = radii(2 / 3, zero=False)
    """A solved pass that moves no stage by more [radii] takes its full step without a look at the
    model: there the linearisation holds."""
    short_turn: float = angle(0.1, zero=False)
    """The same of the headings [rad]."""
    short_speed_change: float = share(2 / 3, zero=False)
    """The same of the speeds, as a share of the fastest."""
    short_turn_rate_change: float = share(1.6 / math.pi, zero=False)
    """The same of the turn rates, as a share of the fastest."""
    straight_defect: float = radii(1 / 30, zero=False)
    """A pass after which the model contradicts the plan by no more over a period [radii] takes its
    full step too."""
    straight_turn_defect: float = angle(5e-3, zero=False)
    """The same of the headings [rad]."""
    armijo: float = part(1e-4)
    """Share of the predicted decrease of the merit function that a step must bring."""
    shortest_step: float = part(0.1)
    """Where a line search ends, as a share of the full step: what is left waits for the next
    period, which knows more."""
    shortest_converging_step: float = part(1e-3)
    """The same for passes to convergence."""

    gauss_newton_passes: int = count(10)
    """From this pass to convergence on every other one uses the exact Hessian, before that only
    after a shortened step: where constraints settle everything, Gauss-Newton converges in five
    passes."""
    least_curvature: float = share(0.1, zero=False)
    """Smallest eigenvalue of a stage's exact Hessian: steps stay finite."""
    penalty_growth: float = share(10.0, zero=False)
    """Factor by which the linear slack weight grows while a converged plan stands in an obstacle,
    and the last growth has halved its depth."""
    largest_penalty: float = share(1e5, zero=False)
    """Largest linear slack weight [1/m]."""
    constraint_tolerance: float = radii(1 / 15000, zero=False)
    """How deep in an obstacle a converged plan may stand [radii]: the accuracy of its QP."""
    least_solve_time: float = clock_seconds(5e-5, zero=False)
    """Time that a QP gets even past a deadline [s]: the iterate that it starts from is no plan."""

    def __post_init__(self) -> None:
        check(self)

    def one_pass(self, history: int) -> OSQPOptions:
        """Settings for one pass a period, of a model with so many past commands."""
        return self.lagging if history else self.real_time
