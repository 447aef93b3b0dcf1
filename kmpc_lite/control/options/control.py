"""Options of the rooms that estimate, keep margins, solve and stop."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import (
    angle,
    check,
    count,
    group,
    part,
    probability,
    radii,
    seconds,
    share,
    switch,
)


@dataclass(frozen=True, slots=True)
class MarginOptions:
    """How wide margins are."""

    risk: float = probability(0.05)
    """Probability of leaving the tube around a plan within its memory (8 periods) that margins are
    made for. A collision is far rarer: the robot would have to leave the tube towards an obstacle
    that the plan touches, and no later step could correct it."""
    headway: float = radii(0.4)
    """Least margin at the fastest speed [radii], in proportion less below it, and never more than
    the clearance of the path: a floor may begin to slip at any time, and a slip of 0.2 pushes a
    robot aside by half of what it drives in a period."""
    side_margin: float = radii(1 / 15)
    """Margin from the sides of the area [radii]: nothing is hit there, the robot must only not
    creep out."""
    step_risk: float = probability(1e-3)
    """Probability that the error of a single command exceeds what its margin allows for; a tenth of
    it with a model that was corrected while driving."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class PoseOptions:
    """What a robot's motion can do in a period, and how long a pose that jumped is waited for."""

    tolerated: float = radii(1 / 3)
    """A position this near to the predicted one has never jumped [radii]: the margins allow for it.
    """
    tolerated_turn: float = angle(0.1)
    """A heading this near to the predicted one has never jumped [rad]."""
    slip: float = share(1.0)
    """How much more difference slipping wheels may make, as a share of the commanded distance: all
    of it where they slide or spin."""
    weighed: bool = switch(True)
    """Whether measured poses and predicted ones are weighed by their noise."""
    agreement: float = seconds(2.0)
    """Poses that jumped are believed once they have agreed with each other for this long [s], which
    is longer than errors of a second last. Zero: they are believed at once."""

    def __post_init__(self) -> None:
        check(self)


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
    """Rounds of scaling. None: the rows are scaled by `NavigationQP`, once for all QPs."""
    check_termination: int = count(10)
    """Iterations between two looks at the residuals."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class SolverOptions:
    """How the nonlinear program is solved."""

    real_time: OSQPOptions = group(OSQPOptions())
    """For the passes of a period. A model with input history, and a robot that turns far in a
    period, get five times the iterations, and an adapted `rho`."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class StepOptions:
    """What a step believes, and how it shares out its time."""

    accepted_defect: float = radii(1 / 3)
    """How far the model's prediction may be from the plan over one period [radii, and 0.15 rad a
    radius]. Beyond it the solver linearises again around the plan; if that does not help, the
    plan's commands are rolled out with the model."""
    guide_share: float = share(1 / 3)
    """Share of a time budget after which a search for a path is left to the next step."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class StopOptions:
    """Which motions to rest are tried, and what clearance they must keep."""

    further_time: float = seconds(0.5)
    """How much of the plan's rest is tried before the brake [s]: a robot that lags may have to
    drive on to stop clear of what it passes."""
    spend_share: float = part(0.25)
    """Share of the present clearance, as far as it is sure, that a motion may use up if that
    clearance is less than the margin: a robot near an obstacle may pass by, one that touches may
    get free."""
    swerve_time: float = seconds(0.3)
    """Longest time for which a moving obstacle may walk in any direction at its speed [s]."""

    def __post_init__(self) -> None:
        check(self)
