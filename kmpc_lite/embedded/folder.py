"""Write the folder of an exported controller: sources, numbers, a build, test vectors.

Vectors are what the controller in Python answers, step by step, on a drive past circles.
"""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite import __version__
from kmpc_lite.control import kernels
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.nmpc.qp_solvers import OSQPWorkspace
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.plan import PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.embedded.numbers import NO_LIMIT, controller_of, numbers_of, sizes_of, solver_of
from kmpc_lite.errors import ProblemError
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

STEPS = 80
STATUSES = (PlanStatus.SOLVED, PlanStatus.FEASIBLE, PlanStatus.FALLBACK, PlanStatus.STOPPED)
"""In the order of `enum kmpc_status`."""
SOURCES = Path(__file__).parent / "c"
KERNELS = Path(kernels.__file__).parent / "c"
ABOUT, FORMAT = "kmpc.json", 3
AROUND = frozenset(
    ("Makefile", "CMakeLists.txt", "library.json", "library.properties", "example.c", "vectors.c")
)
"""What is no source of the library."""
NOT_CALLED = ("module.c", "boxes.c", "clusters.c", "scan_beams.c", "scan_map.c", "tracks.c")
GUARD = "#define KMPC_KERNELS_H\n"


class Vector(NamedTuple):
    """What comes in, in metres and seconds, and the answer."""

    pose: Array
    goal: Array
    circles: Array
    command: Array
    status: int


def recorded_vectors(controller: Controller, steps: int = STEPS) -> list[Vector]:
    """Drive a controller past two circles, one of which moves, and two steps that are refused.

    Sizes follow the robot: circles are as large as it is, and lie on the right of its way, which
    turns left and is as long as it drives in a few seconds. (Before it they would make a plan hang
    between two sides, where the last bit of a number decides.)
    """
    problem, model = controller.problem, controller.model
    speed, radius = float(max(problem.u_max[0], -problem.u_min[0])), problem.robot_radius
    way = max(0.35 * steps * problem.dt * speed, 12.0 * radius)
    low, high = problem.bounds[2][:2], problem.bounds[3][:2]
    bounded = np.isfinite(low) & np.isfinite(high)
    low, high = np.where(bounded, low, 0.0), np.where(bounded, high, 0.0)
    middle, room = 0.5 * (low + high), np.where(bounded, 0.35 * (high - low), np.inf)
    half = np.minimum(0.5 * way, room)
    start, goal = np.array([*(middle - half), 0.3]), np.array([*(middle + half), 0.0])
    pose, past = start, np.zeros((model.history, 2))
    vectors = []
    controller.reset()
    for k in range(steps):
        moving = middle + (0.3 * half[0], -half[1] + 0.1 * speed * problem.dt * k)
        circles = np.array(
            [
                [*(middle - 0.35 * half + (1.5 * radius, -1.5 * radius)), radius, 0.0, 0.0],
                [*moving, radius, 0.0, 0.1 * speed],
            ]
        )
        told = np.full(3, np.nan) if k in (20, 21) else pose
        plan = controller.step(told, goal, circles)
        status = STATUSES.index(plan.status)
        vectors.append(Vector(told, goal, circles, plan.command, status))
        pose = model.predict(pose, plan.command, past)
        if model.history:
            past = np.concatenate([past[1:], plan.command[None]])
    controller.reset()
    return vectors


def export(
    model: KoopmanModel,
    problem: NavigationProblem,
    folder: str | os.PathLike[str],
    *,
    float32: bool = False,
    tightening: bool = True,
    options: ControllerOptions | None = None,
) -> Path:
    """Write a controller as C99: one folder that a microcontroller's build takes in.

    It is `Controller(model, problem, guidance=False, adaptation=False)` that takes poses as they
    are measured: it steers for its goal past circles, keeps margins, and is always able to stop.
    `make test` in the folder checks it against that controller's answers on a recorded drive.

    Parameters
    ----------
    model : KoopmanModel
        Symmetric, as `fit` makes them.
    problem : NavigationProblem
        Of a round robot.
    folder : path
        Made; an older export in it is replaced.
    float32 : bool
        Whether all numbers are float: half the memory, and fast where a unit for double is missing.
    tightening : bool
        Whether margins are kept for what the model does not know.
    options : ControllerOptions, optional
        Everything else that can be tuned.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    ProblemError
        For a model or a problem that the C code does not have, and for a folder that holds
        something else, or cannot be written.
    """
    controller = controller_of(model, problem, tightening=tightening, options=options)
    target = Path(folder)
    if target.exists() and not (target / ABOUT).is_file() and any(target.iterdir()):
        raise ProblemError(f"export: {target} is not empty, and no exported controller is in it")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        made = Path(tempfile.mkdtemp(prefix=f".{target.name}-", dir=target.parent))
        try:
            _write(made, controller, float32)
            if target.exists():
                shutil.rmtree(target)
            made.chmod(0o755)
            made.rename(target)
        except BaseException:
            shutil.rmtree(made, ignore_errors=True)
            raise
    except OSError as error:
        raise ProblemError(f"export: {target} cannot be written: {error.strerror}") from error
    return target


def _write(folder: Path, controller: Controller, float32: bool) -> None:
    sources = folder / "src"
    sources.mkdir()
    for source in sorted([*SOURCES.iterdir(), *KERNELS.glob("*.[ch]")]):
        if source.name not in NOT_CALLED:
            shutil.copy(source, (folder if source.name in AROUND else sources) / source.name)
    sqp = solver_of(controller)
    sizes = sizes_of(controller, sqp.qp)
    assert isinstance(sqp.workspace, OSQPWorkspace)
    sqp.workspace.write_code(sources / "osqp", float32)
    (sources / "kmpc_sizes.h").write_text(_sizes_header(sizes, controller.problem))
    (sources / "kmpc_numbers.c").write_text(_numbers_source(numbers_of(controller, sqp), float32))
    (folder / "vectors.h").write_text(_vectors_header(recorded_vectors(controller), float32))
    about = {
        "format": FORMAT,
        "float32": float32,
        "dt": controller.problem.dt,
        "sizes": sizes,
        "robot_radius": controller.problem.robot_radius,
        "model": dict(controller.model.info).get("method", "made by hand"),
    }
    (folder / ABOUT).write_text(json.dumps(about, indent=1) + "\n")
    # in a header, not as flags: build systems that take sources alone have no place for flags
    defined = f"#define KMPC_HORIZON {sizes['KMPC_N']}\n" + "#define KMPC_FLOAT\n" * float32
    _replace(sources / "kernels.h", GUARD, f"{GUARD}\n{defined}")
    for library in (folder / "library.json", folder / "library.properties"):
        _replace(library, "@VERSION@", __version__.replace(".dev", "-dev"))  # SemVer


def _replace(file: Path, old: str, new: str) -> None:
    file.write_text(file.read_text().replace(old, new))


def _sizes_header(sizes: dict[str, int], problem: NavigationProblem) -> str:
    lines = [f"#define {name} {value}" for name, value in sizes.items()]
    return (
        "/* Sizes of one controller, made by kmpc export. */\n"
        "#ifndef KMPC_SIZES_H\n#define KMPC_SIZES_H\n\n"
        + "\n".join(lines)
        + f"\n#define KMPC_DT R({problem.dt!r}) /* period [s] */\n"
        + f"#define KMPC_RADIUS R({problem.robot_radius!r}) /* of the robot [m] */\n\n#endif\n"
    )


def _numbers_source(numbers: dict[str, Any], float32: bool) -> str:
    lines = [
        "/* The numbers of one controller, made by kmpc export: core.h says what they are. */",
        '#include "core.h"',
        "",
        "const struct kmpc_numbers kmpc_numbers = {",
        *_initialiser(numbers, float32),
        "};",
    ]
    return "\n".join([*lines, ""])


def _initialiser(numbers: dict[str, Any], float32: bool) -> list[str]:
    told = {
        name: [literal(v, float32) for v in np.ravel(value).tolist()]
        for name, value in numbers.items()
    }
    return [
        f"    .{name} = {words[0] if np.ndim(numbers[name]) == 0 else braced(words)},"
        for name, words in told.items()
    ]


def braced(told: Iterable[str]) -> str:
    """Numbers as an initialiser in C."""
    return f"{{{', '.join(told)}}}"


def literal(value: float, float32: bool) -> str:
    """A number in C; infinity is written as what is larger than all others."""
    if isinstance(value, int):
        return str(value)
    if np.isnan(value):
        return "NAN"
    value = float(np.clip(value, -NO_LIMIT, NO_LIMIT))
    return f"{np.float32(value).item()!r}f" if float32 else repr(value)


def _vectors_header(vectors: list[Vector], float32: bool) -> str:
    def rows(values: Iterable[Any]) -> str:
        return ",\n    ".join(
            braced(literal(v, float32) for v in np.ravel(row).tolist()) for row in values
        )

    circles = max(len(v.circles) for v in vectors)
    return (
        "/* What the controller in Python answers on a drive, made by kmpc export. */\n"
        f"enum {{ VECTORS = {len(vectors)}, CIRCLES = {circles} }};\n"
        f"static const real vector_pose[][3] = {{\n{rows(v.pose for v in vectors)}}};\n"
        f"static const real vector_goal[][3] = {{\n{rows(v.goal for v in vectors)}}};\n"
        f"static const real vector_circle[][5 * CIRCLES] = {{\n"
        f"{rows(v.circles for v in vectors)}}};\n"
        f"static const real vector_command[][2] = {{\n{rows(v.command for v in vectors)}}};\n"
        f"static const int vector_status[] = {{{', '.join(str(v.status) for v in vectors)}}};\n"
    )
