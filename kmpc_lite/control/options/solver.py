"""Options of the solver: how a QP is solved."""

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
    """For the passes of a period. A model with input history, and a robot that turns far in a
    period, get five times the iterations, and an adapted `rho`."""

    def __post_init__(self) -> None:
        check(self)
