"""acados SQP_RTI with HPIPM: the same problem with the same soft obstacles, as generated C.

acados is no dependency. `install` fetches the wheel ``comma-deps-acados`` (x86-64 Linux, acados
0.2.2), one version with one hash, into a folder of its own: the wheel brings a CasADi that would
replace the real one, so that part is thrown away. A C compiler and make are needed.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib.util
import io
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lab.peers.ipopt import check_weights, papers_problem, short_way, symbolic_step
from kmpc_lite.control.plan import Plan, PlannedAround, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.shapes import Circle, circles_to_array
from kmpc_lite.errors import KmpcError, ProblemError
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, STATES, Array

WHEEL = "comma-deps-acados==0.2.2.post92"
WHEEL_HASH = "sha256:fb317ea65c68d410e19b46f824c333203a097d02dac6fbbdc1f378c2b32b456f"
"""The one file that was tested: it brings programs that are run, so no other is installed."""
FAR_AWAY = (1e3, 1e3, 0.0, 0.0, 0.0)


def default_folder() -> Path:
    """Folder that `install` uses: under the user's cache."""
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "kmpc_lite" / "acados"


def why_not(folder: Path | None = None) -> str:
    """Say in a few words why acados cannot be used here; empty if it can."""
    if platform.system() != "Linux" or platform.machine() != "x86_64":
        return f"the wheel is for x86-64 Linux, this is {platform.system()} {platform.machine()}"
    if not (shutil.which("gcc") or shutil.which("cc")) or not shutil.which("make"):
        return "a C compiler and make are needed"
    if importlib.util.find_spec("casadi") is None:
        return "CasADi is needed: pip install 'kmpc-lab[peers]'"
    if not ((folder or default_folder()) / "acados" / "install").is_dir():
        return "not installed: kmpc bench --install-acados"
    return ""


def install(folder: Path | None = None) -> Path:
    """Put the wheel into a folder, without the CasADi that comes with it.

    Raises KmpcError if pip fails, as for a wheel of another hash; with pip's last line.
    """
    target = folder or default_folder()
    target.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
        wanted = Path(scratch) / "wanted.txt"
        wanted.write_text(f"{WHEEL} --hash={WHEEL_HASH}\n", encoding="ascii")
        checked = ("--no-deps", "--only-binary=:all:", "--require-hashes", "-r", str(wanted))
        command = [sys.executable, "-m", "pip", "install", "--quiet", *checked, "--target", scratch]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise KmpcError(
                f"pip could not install {WHEEL}: "
                f"{(done.stderr.strip().splitlines() or ['no output'])[-1]}"
            )
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir()
        shutil.move(str(Path(scratch) / "acados"), target / "acados")
    return target


def prepare(folder: Path) -> Path:
    """Lay out what acados' templates expect and load its libraries; returns the layout's root.

    The environment variables that acados reads are set, too.
    """
    package = folder / "acados"
    root = folder / "root"
    links = {
        "lib": package / "install/lib",
        "include": package / "install/include",
        "bin": package / "install/bin",
        "interfaces/acados_template/acados_template": package / "acados_template",
    }
    for name, target in links.items():
        link = root / name
        link.parent.mkdir(parents=True, exist_ok=True)
        if not link.is_symlink():
            link.symlink_to(target)
    os.environ["ACADOS_SOURCE_DIR"] = str(root)
    os.environ["TERA_PATH"] = str(package / "install/bin/t_renderer")
    # loaded here and for all, the generated solver finds them without LD_LIBRARY_PATH, which would
    # come too late now
    for library in ("libblasfeo.so", "libhpipm.so", "libqpOASES_e.so", "libacados.so"):
        ctypes.CDLL(str(package / "install/lib" / library), mode=ctypes.RTLD_GLOBAL)
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
    return root


class AcadosController:
    """One SQP_RTI step of acados per period, obstacles soft with the same penalties as ours.

    `model`: its prediction becomes the discrete dynamics. `problem`: the paper's if not given.
    `obstacles`: how many circles the generated solver has room for; fewer are filled up with ones
    far away. Raises KmpcError if acados cannot be used; says why. Raises ProblemError for a problem
    that limits the change of commands.
    """

    def __init__(
        self, model: KoopmanModel, problem: NavigationProblem | None = None, obstacles: int = 4
    ) -> None:
        if problem is not None and problem.limits_changes:
            raise ProblemError(
                "the acados peer knows no limits on the change of commands: du_max must be infinite"
            )
        if problem is not None and problem.limits_wheels:
            raise ProblemError("the acados peer knows no wheels: max_wheel_speed must be infinite")
        reason = why_not()
        if reason:
            raise KmpcError(f"acados: {reason}")
        self.problem = papers_problem() if problem is None else check_weights(problem)
        self.obstacles = obstacles
        prepare(default_folder())
        self._work = tempfile.TemporaryDirectory(prefix="kmpc_acados_")
        self._solver = build_solver(model, self.problem, obstacles, Path(self._work.name))
        self.reset()

    def reset(self) -> None:
        """Forget the last solution."""
        self._plan: tuple[Array, Array] | None = None
        self._known = b""

    def step(
        self, x: ArrayLike, goal: ArrayLike, obstacles: Sequence[Circle] | ArrayLike = ()
    ) -> Plan:
        """Plan from the measured pose (3,) to the goal (3,); see `Controller.step`."""
        pose = np.asarray(x, dtype=float)
        target = np.asarray(goal, dtype=float)
        circles = circles_to_array(obstacles)
        if len(circles) > self.obstacles:
            raise ValueError(
                f"obstacles: the solver was generated for {self.obstacles}, got {len(circles)}"
            )
        n, solver = self.problem.horizon, self._solver
        start = perf_counter()
        target = short_way(target, pose)
        self._set(pose, target, circles)
        prepared = perf_counter()
        status = solver.solve()
        solved = perf_counter()
        states = np.array([solver.get(k, "x") for k in range(n + 1)])
        inputs = np.array([solver.get(k, "u") for k in range(n)])
        usable = bool(np.isfinite(states).all() and np.isfinite(inputs).all())
        self._plan = (
            (np.vstack([states[1:], states[-1:]]), np.vstack([inputs[1:], inputs[-1:]]))
            if usable
            else None
        )
        end = perf_counter()
        u_min, u_max, _, _ = self.problem.bounds
        command = np.clip(np.where(np.isfinite(inputs[0]), inputs[0], 0.0), u_min, u_max)
        seen = circles if usable else circles[:0]
        good = status in (0, 2) and usable
        return Plan(
            command,
            states,
            inputs,
            PlanStatus.SOLVED if good else PlanStatus.FALLBACK,
            1,
            # setting and reading through Python is not acados' own time: it is listed apart
            {
                "set": prepared - start,
                "solve": solved - prepared,
                "read": end - solved,
                "total": end - start,
            },
            "" if good else f"acados status {status}",
            around=PlannedAround(seen.copy(), None, self.problem.robot_radius, self.problem.dt),
        )

    def _set(self, pose: Array, target: Array, circles: Array) -> None:
        """Tell the solver a pose (3,), a goal (3,), circles (M, 5), and where to start from."""
        n, dt, solver = self.problem.horizon, self.problem.dt, self._solver
        slots = np.array([*circles, *[FAR_AWAY] * (self.obstacles - len(circles))])
        states, inputs = self._plan or (np.tile(pose, (n + 1, 1)), np.zeros((n, INPUTS)))
        known = target.tobytes() + slots.tobytes()
        if known != self._known:
            # every call into C costs: only what is new is set
            self._known = known
            y_ref = np.concatenate([target, np.zeros(INPUTS)])
            for k in range(n + 1):
                centres = slots[:, :2] + k * dt * slots[:, 3:]
                solver.set(k, "p", np.hstack([centres, slots[:, 2:3]]).ravel())
                solver.set(k, "yref", y_ref if k < n else target)
        for k in range(n + 1):
            solver.set(k, "x", states[k])
            if k < n:
                solver.set(k, "u", inputs[k])
        solver.set(0, "lbx", pose)
        solver.set(0, "ubx", pose)


def build_solver(
    model: KoopmanModel, problem: NavigationProblem, obstacles: int, folder: Path
) -> Any:
    """Generate, compile and load the solver in a folder, with room for a number of circles."""
    from acados.acados_template import AcadosOcp, AcadosOcpSolver  # type: ignore[import-not-found]

    ocp = AcadosOcp()
    ocp.model, ocp.dims.N = _acados_model(model, problem, obstacles), problem.horizon
    # the folder is that of one controller: no other may load its library. In C the name may hold
    # letters and digits, and no underscore at its end
    ocp.model.name = "kmpc_" + "".join(c if c.isalnum() else "0" for c in folder.name)
    ocp.parameter_values = np.zeros(3 * obstacles)
    _set_cost(ocp, problem)
    _set_bounds(ocp, problem)
    _set_soft_obstacles(ocp, problem, obstacles)
    _set_options(ocp, problem)
    ocp.code_export_directory = str(folder / "code")
    here = os.getcwd()
    try:
        os.chdir(folder)
        with contextlib.redirect_stdout(io.StringIO()), _quiet_file_descriptors():
            return AcadosOcpSolver(ocp, json_file=str(folder / "ocp.json"))
    finally:
        os.chdir(here)


def _acados_model(model: KoopmanModel, problem: NavigationProblem, obstacles: int) -> Any:
    """Dynamics, and the clearance of every circle (x, y, radius) given as a parameter."""
    import casadi as ca
    from acados.acados_template import AcadosModel

    x, u, p = ca.SX.sym("x", STATES), ca.SX.sym("u", INPUTS), ca.SX.sym("p", 3 * obstacles)
    clearances = [
        ca.sqrt(ca.sumsqr(x[:2] - p[3 * i : 3 * i + 2]))
        - p[3 * i + 2]
        - problem.robot_radius
        - problem.margin
        for i in range(obstacles)
    ]
    described = AcadosModel()
    described.x, described.u, described.p = x, u, p
    described.disc_dyn_expr = symbolic_step(model)(x, u)
    described.con_h_expr = described.con_h_expr_e = ca.vertcat(*clearances)
    return described


def _set_cost(ocp: Any, problem: NavigationProblem) -> None:
    q, r, q_terminal = problem.weights
    ocp.cost.cost_type = ocp.cost.cost_type_e = "LINEAR_LS"
    # acados halves squares, and weighs a stage, but not the end, by its length in seconds
    ocp.cost.W = 2 / problem.dt * np.block([[q, np.zeros((3, 2))], [np.zeros((2, 3)), r]])
    ocp.cost.W_e = 2 * q_terminal
    ocp.cost.Vx, ocp.cost.Vu, ocp.cost.Vx_e = np.eye(5, 3), np.eye(5, 2, -3), np.eye(3)
    ocp.cost.yref, ocp.cost.yref_e = np.zeros(5), np.zeros(3)


def _set_bounds(ocp: Any, problem: NavigationProblem) -> None:
    u_min, u_max, x_min, x_max = problem.bounds
    bounds = ocp.constraints
    bounds.lbu, bounds.ubu, bounds.idxbu = u_min, u_max, np.arange(2)
    bounds.lbx, bounds.ubx, bounds.idxbx = x_min[:2], x_max[:2], np.arange(2)
    bounds.x0 = np.zeros(3)


def _set_soft_obstacles(ocp: Any, problem: NavigationProblem, obstacles: int) -> None:
    linear, quadratic = problem.slack_weights
    for end, scale in (("", 1 / problem.dt), ("_e", 1.0)):
        setattr(ocp.constraints, f"lh{end}", np.zeros(obstacles))
        setattr(ocp.constraints, f"uh{end}", np.full(obstacles, 1e6))
        setattr(ocp.constraints, f"idxsh{end}", np.arange(obstacles))
        for weight, value in (("zl", linear), ("zu", 0.0), ("Zl", 2 * quadratic), ("Zu", 0.0)):
            setattr(ocp.cost, f"{weight}{end}", np.full(obstacles, scale * value))


def _set_options(ocp: Any, problem: NavigationProblem) -> None:
    options = ocp.solver_options
    options.tf = problem.horizon * problem.dt
    options.integrator_type, options.hessian_approx = "DISCRETE", "GAUSS_NEWTON"
    options.nlp_solver_type, options.qp_solver = "SQP_RTI", "PARTIAL_CONDENSING_HPIPM"
    options.print_level = 0
    # HPIPM at its best here: with the default tolerance of 1e-6 it always ran to its limit of
    # 50 iterations, ten times as long
    options.hpipm_mode, options.qp_solver_cond_N = "SPEED", max(1, problem.horizon // 4)
    options.qp_solver_tol_stat = options.qp_solver_tol_eq = options.qp_solver_tol_ineq = (
        options.qp_solver_tol_comp
    ) = 1e-4


@contextlib.contextmanager
def _quiet_file_descriptors() -> Any:
    """Keep the compiler's and the template engine's words off the terminal."""
    sys.stdout.flush()
    saved = [os.dup(1), os.dup(2)]
    with open(os.devnull, "w") as nothing:
        os.dup2(nothing.fileno(), 1)
        os.dup2(nothing.fileno(), 2)
        try:
            yield
        finally:
            for descriptor, copy in zip((1, 2), saved, strict=True):
                os.dup2(copy, descriptor)
                os.close(copy)
