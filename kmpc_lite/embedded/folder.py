"""Write the folder of an exported controller: sources, numbers, a build, test vectors."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lite.control import kernels
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.embedded.numbers import NO_LIMIT, check_can_be_exported, numbers_of, sizes_of
from kmpc_lite.embedded.vectors import Vector, recorded_vectors
from kmpc_lite.errors import ProblemError
from kmpc_lite.model.koopman import KoopmanModel

SOURCES = Path(__file__).parent / "c"
KERNELS = Path(kernels.__file__).parent / "c"
WHOLE = frozenset(
    ("sides", "term", "terms", "nodes", "limits_changes", "longest_ramp", "further", "most_passes")
    + ("tightens", "errs", "lasts", "by_speed", "delay", "spreads", "places", "next_stage")
)
"""Members of `struct kmpc_numbers` that are whole numbers."""
ABOUT = "kmpc.json"


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

    It is `Controller(model, problem, guidance=False, adaptation=False)`: it steers for its goal
    past circles, keeps margins, and is always able to stop. `make test` in the folder checks it
    against that controller's answers on a recorded drive.

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
    check_can_be_exported(model, problem)
    target = Path(folder)
    if target.exists() and not (target / ABOUT).is_file() and any(target.iterdir()):
        raise ProblemError(f"export: {target} is not empty, and no exported controller is in it")
    controller = Controller(
        model,
        problem,
        guidance=False,
        adaptation=False,
        tightening="learned" if tightening else None,
        compiled=False,
        options=options,
    )
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
    for source in sorted([*SOURCES.iterdir(), *KERNELS.glob("*.[ch]")]):
        if source.name != "module.c":
            shutil.copy(source, folder / source.name)
    sizes = sizes_of(controller)
    _write_solver(folder / "osqp", controller, float32)
    (folder / "kmpc_sizes.h").write_text(_sizes_header(sizes, controller.problem))
    (folder / "kmpc_numbers.c").write_text(_numbers_source(numbers_of(controller), float32))
    vectors = recorded_vectors(controller)
    (folder / "vectors.h").write_text(_vectors_header(vectors, float32))
    about = {
        "format": 1,
        "float32": float32,
        "dt": controller.problem.dt,
        "sizes": sizes,
        "robot_radius": controller.problem.robot_radius,
        "model": dict(controller.model.info).get("method", "made by hand"),
    }
    (folder / ABOUT).write_text(json.dumps(about, indent=1) + "\n")
    flags = "-DKMPC_FLOAT " if float32 else ""
    makefile = (folder / "Makefile").read_text().replace("@HORIZON@", str(sizes["KMPC_N"]))
    (folder / "Makefile").write_text(makefile.replace("@PRECISION@ ", flags))
    cmake = (folder / "CMakeLists.txt").read_text().replace("@HORIZON@", str(sizes["KMPC_N"]))
    (folder / "CMakeLists.txt").write_text(
        cmake.replace("@PRECISION@", "KMPC_FLOAT" if float32 else "")
    )


def _write_solver(folder: Path, controller: Controller, float32: bool) -> None:
    """OSQP's own embedded code for this QP (`osqp.codegen`)."""
    workspace = controller._sqp.workspace
    workspace._set_up()  # type: ignore[attr-defined]
    with open(os.devnull, "w") as nowhere, contextlib.redirect_stdout(nowhere):
        workspace._osqp.codegen(  # type: ignore[attr-defined]
            str(folder),
            parameters="matrices",
            use_float=float32,
            printing_enable=False,
            profiling_enable=False,
            interrupt_enable=False,
            prefix="kmpc_",
            compile=False,
        )
    for name in ("setup.py", "bindings.cpp", "emosqp.c", "Makefile", "CMakeLists.txt"):
        (folder / name).unlink(missing_ok=True)


def _sizes_header(sizes: dict[str, float], problem: NavigationProblem) -> str:
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
    ]
    for name, value in numbers.items():
        flat = np.ravel(value).tolist()
        whole = name in WHOLE
        told = [str(int(v)) if whole else literal(float(v), float32) for v in flat]
        scalar = np.ndim(value) == 0
        # a zero stands for an array of them
        body = told[0] if scalar and told[0] != "0" else f"{{{', '.join(told)}}}"
        lines.append(f"    .{name} = {told[0] if scalar and name not in ARRAYS else body},")
    return "\n".join([*lines, "};", ""])


ARRAYS = frozenset(("position_errors", "heading_errors", "command_noise"))
"""Arrays that may be given as one zero."""


def literal(value: float, float32: bool) -> str:
    """A number in C; infinity is written as what is larger than all others."""
    # what is no number cannot be written: the vectors' reader knows it by its size
    value = NO_LIMIT if np.isnan(value) else float(np.clip(value, -NO_LIMIT, NO_LIMIT))
    text = repr(float(np.float32(value)) if float32 else value)
    return text + "f" if float32 else text


def _vectors_header(vectors: list[Vector], float32: bool) -> str:
    def rows(values: Iterable[Any]) -> str:
        return ",\n".join(
            "    {" + ", ".join(literal(float(v), float32) for v in np.ravel(row)) + "}"
            for row in values
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
