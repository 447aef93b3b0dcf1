"""Who takes part: ours in several forms, and the peers that are installed."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from kmpc_lite.control.controller import Controller
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel

Build = Callable[[KoopmanModel, NavigationProblem, int], Any]


@dataclass(frozen=True)
class Contender:
    """A controller by name, and how to make it."""

    name: str
    build: Build
    """From model, problem and the number of obstacles."""
    skipped: str = ""
    """Why it does not take part here."""
    timed: str = "total"
    """Which entry of a plan's timing is compared."""


def plain(model: KoopmanModel, problem: NavigationProblem, obstacles: int = 0) -> Controller:
    """Make ours in the paper's formulation: goal as reference, no margins, one pass a step."""
    return Controller(model, problem, guidance=False, tightening=None)


def full(model: KoopmanModel, problem: NavigationProblem, obstacles: int = 0) -> Controller:
    """Make ours with everything on: guidance and learned margins."""
    return Controller(model, problem)


def _converged(model: KoopmanModel, problem: NavigationProblem, obstacles: int) -> Any:
    return Controller(
        model, problem, guidance=False, tightening=None, sqp_iterations=200, tolerance=1e-6
    )


def _casadi(solver: str) -> Build:
    def build(model: KoopmanModel, problem: NavigationProblem, obstacles: int) -> Any:
        from kmpc_lite.peers.ipopt import IpoptController

        return IpoptController(model, problem, solver)

    return build


def _acados(model: KoopmanModel, problem: NavigationProblem, obstacles: int) -> Any:
    from kmpc_lite.peers.acados import AcadosController

    return AcadosController(model, problem, obstacles)


def contenders() -> list[Contender]:
    """All of them, those that cannot take part here with the reason."""
    from kmpc_lite.peers.acados import why_not

    casadi = without_casadi()
    return [
        Contender("ours, RTI", plain),
        Contender("ours, converged", _converged),
        Contender("CasADi + IPOPT", _casadi("ipopt"), casadi),
        Contender("CasADi + fatrop", _casadi("fatrop"), casadi),
        Contender("acados RTI, in C", _acados, why_not(), timed="solve"),
        Contender("acados RTI, Python", _acados, why_not()),
    ]


def full_contenders() -> list[Contender]:
    """Ours with everything on, beside what is compared to it: on the states of its own drives."""
    return [
        Contender("ours, full step", full),
        Contender("CasADi + IPOPT", _casadi("ipopt"), without_casadi()),
    ]


def without_casadi() -> str:
    """Say why CasADi cannot take part; empty if it can."""
    return (
        ""
        if importlib.util.find_spec("casadi")
        else "CasADi is not installed: pip install 'kmpc-lite[peers]'"
    )
