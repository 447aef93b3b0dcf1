"""Options of the solver: how a QP is solved, how many passes are made, and when they end."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, count, group, share, switch


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
    """For the passes of a period."""
    thorough: OSQPOptions = group(
        OSQPOptions(max_iter=300, adaptive_rho=True, adaptive_rho_interval=60)
    )
    """The same for a model with input history, and for a robot that turns far in a period: what it
    still does of past commands it cannot take back, and the multipliers become large."""
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

    def __post_init__(self) -> None:
        check(self)
