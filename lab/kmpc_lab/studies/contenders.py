"""Controllers that studies and benchmarks compare: one way to say which one to build."""

from __future__ import annotations

import importlib.util
import shutil
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import qpsolvers

from kmpc_lab.sim.plants.robots import DifferentialDrive, generate_dataset
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.embedded.compiled_controller import CompiledController
from kmpc_lite.embedded.folder import export
from kmpc_lite.learn.calibration import with_quantiles
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.regression import Method
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scenario.files import Scenario

Form = Literal["full", "paper", "exported", "ipopt", "fatrop", "acados"]
"""Ours with everything on; ours in the paper's formulation (the goal as reference, no learned
margins), one pass a step; ours with margins as `kmpc export` writes it, all in C; CasADi with IPOPT
or fatrop; acados."""
DT = 0.1  # sampling period of all studies [s]
EPISODES, STEPS = 1000, 1000  # drives that the paper learns from, and periods of each
TRAINING_SEED = 1_000  # of training data


@dataclass(frozen=True)
class Contender:
    """A controller by its label, and what a worker needs to build it: it pickles."""

    label: str  # name in tables and files
    form: Form = "full"
    fit: Method | None = "integral"  # how studies learn its model; None is the nominal unicycle
    margin: float = 0.0
    """Distance to keep beyond the radii in a study, instead of the map's own [m]."""
    adaptation: bool | None = None
    """Whether ours adapts its model while driving; its own choice if not given."""
    solver: str = "osqp"  # QP solver of ours, by the name that qpsolvers has for it
    timed: str = "total"  # entry of a plan's timing that benchmarks compare

    @property
    def missing(self) -> str:
        """Why it cannot take part on this machine; empty if it can."""
        if self.form in ("ipopt", "fatrop"):
            found = importlib.util.find_spec("casadi")
            return "" if found else "CasADi is not installed: pip install 'kmpc-lab[peers]'"
        if self.form == "acados":
            from kmpc_lab.peers.acados import why_not

            return why_not()
        if self.form == "exported" and not (shutil.which("cc") and shutil.which("make")):
            return "a C compiler (cc) and make are needed"
        if self.form == "paper" and self.solver not in qpsolvers.available_solvers:
            return f"{self.solver} is not installed"
        return ""

    def build(self, model: KoopmanModel, scenario: Scenario) -> Any:
        """Make the controller for a scenario: its problem, with the contender's margin."""
        problem = replace(scenario.problem(), margin=self.margin)
        obstacles, age = scenario.obstacle_count, scenario.pose_age
        return self.make(model, problem, obstacles, age, scenario.options)

    def make(
        self,
        model: KoopmanModel,
        problem: NavigationProblem,
        obstacles: int = 0,
        pose_age: float = 0.0,
        options: ControllerOptions | None = None,
    ) -> Any:
        """Make the controller for a problem.

        `model`: predicts the robot. `problem`: what is asked of the controller. `obstacles`: most
        obstacles that it will meet; only acados must know. `pose_age`: age of the poses it will get
        [s]; only ours makes use of it. `options`: what ours is tuned with. Returns what has `step`
        and `reset` as `Controller` has them.
        """
        if self.form == "ipopt" or self.form == "fatrop":
            from kmpc_lab.peers.ipopt import IpoptController

            return IpoptController(model, problem, self.form)
        if self.form == "acados":
            from kmpc_lab.peers.acados import AcadosController

            return AcadosController(model, problem, obstacles)
        if self.form == "exported":
            with tempfile.TemporaryDirectory() as folder:
                return CompiledController(export(model, problem, Path(folder) / "robot"))
        if self.form == "full":
            return Controller(
                model,
                problem,
                adaptation=self.adaptation,
                pose_age=pose_age,
                solver=self.solver,
                options=options,
            )
        return Controller(
            model,
            problem,
            guidance=False,
            tightening=None,
            pose_age=pose_age,
            solver=self.solver,
            options=options,
        )


EVERYTHING = Contender("ours, everything on")
UNADAPTED = Contender("ours, no adaptation", adaptation=False)
TABLE_1_CONTENDERS = (
    Contender("NMPC, IPOPT", "ipopt", None),
    Contender("K-NMPC, IPOPT", "ipopt", "edmdc"),
    Contender("ours, paper's formulation", "paper", "edmdc"),
    Contender("ours, paper's, integral fit", "paper"),
    EVERYTHING,
)
"""Rows of table 1."""
STUDY_CONTENDERS = (*TABLE_1_CONTENDERS, UNADAPTED)  # all that studies choose from
PAPER_FORM = Contender("ours, RTI", "paper")
FULL_STEP = Contender("ours, full step")
COLD_CONTENDERS = (
    Contender("CasADi + IPOPT", "ipopt"),
    Contender("CasADi + fatrop", "fatrop"),
    Contender("acados RTI, in C", "acados", timed="solve"),
    Contender("acados RTI, Python", "acados"),
    PAPER_FORM,
    Contender("ours, RTI, QP by DAQP", "paper", solver="daqp"),
    FULL_STEP,
    Contender("ours, margins, exported", "exported"),
)
"""Benchmarked one after the other step by step, as a robot's caches find them."""


def solver_contenders() -> list[Contender]:
    """Ours in the paper's formulation with each QP solver that is installed; OSQP comes first."""
    names = ["osqp", *sorted(set(qpsolvers.available_solvers) - {"osqp"})]
    return [Contender(name, "paper", solver=name) for name in names]


def train(
    slip: float, method: Method, episodes: int = EPISODES, steps: int = STEPS
) -> KoopmanModel:
    """Learn as the paper does, at one slip; quantiles for margins come from drives of their own."""
    plant = DifferentialDrive(slip, seed=TRAINING_SEED)
    model = fit(generate_dataset(plant, episodes, steps, DT, seed=TRAINING_SEED + 1), method=method)
    if method == "edmdc":
        return model
    held = generate_dataset(
        DifferentialDrive(slip, seed=TRAINING_SEED + 2),
        max(episodes // 5, 10),
        max(steps // 5, 100),
        DT,
        seed=TRAINING_SEED + 3,
    )
    return with_quantiles(model, held)
