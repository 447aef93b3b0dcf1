"""Drive with an exported controller from Python: the same C code, as a library of this machine."""

from __future__ import annotations

import ctypes
import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.input_checks import step_numbers
from kmpc_lite.control.plan import PlanStatus
from kmpc_lite.control.world.scene import PREPARED
from kmpc_lite.control.world.shapes import Circle, circles_to_array
from kmpc_lite.embedded.folder import ABOUT, FORMAT, STATUSES
from kmpc_lite.errors import ProblemError
from kmpc_lite.types import INPUTS, STATES, Array

LIBRARY = "libkmpc.so"
PATH = 64  # poses of a path at most: KMPC_PATH


@dataclass(frozen=True, eq=False)
class CompiledPlan:
    """What a step of an exported controller answers; as `Plan`, as far as it goes."""

    command: Array
    """(2,) finite, within bounds [m/s, rad/s]."""
    states: Array
    """(N + 1, 3) [m, m, rad]."""
    inputs: Array
    """(N, 2) [m/s, rad/s]."""
    status: PlanStatus
    iterations: int
    """Passes of the SQP."""
    reason: str
    """Why it is not SOLVED; empty else."""


class CompiledController:
    """The controller of a folder that `export` wrote, built by the C compiler of this machine.

    Parameters
    ----------
    folder : path
        With its sources; the library is built there if it is missing or older than they are.

    Attributes
    ----------
    dt : float
        Period [s].
    horizon : int
        Stages of a plan.

    Raises
    ------
    ProblemError
        For a folder that holds no export, of another format, or if there is no compiler.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        about = _read_about(self.folder)
        self.dt, self.horizon = float(about["dt"]), int(about["sizes"]["KMPC_N"])
        self._real = ctypes.c_float if about["float32"] else ctypes.c_double
        self._kind = np.float32 if about["float32"] else np.float64
        self._library = _load(_built(self.folder))
        self._input, plan = _structures(self._real, self.horizon)
        self._plan = plan()
        bytes_of_robot = ctypes.c_int.in_dll(self._library, "kmpc_bytes").value
        self._robot = ctypes.create_string_buffer(bytes_of_robot)
        self._step = self._library.kmpc_step
        self._step.restype = self._library.kmpc_reset.restype = None
        self.reset()

    def reset(self) -> None:
        """Forget the drive: the robot stands."""
        self._library.kmpc_reset(ctypes.byref(self._robot))

    def set_path(self, poses: ArrayLike) -> None:
        """Follow a path from its pose nearest to the robot on, and stand at its end.

        Without any poses it drives to the goal again.

        Parameters
        ----------
        poses : array_like
            (count, 3) [m, m, rad], at most 64: straight lines, and turns on the spot.

        Raises
        ------
        ValueError
            For wrong shapes, too many poses, and numbers that are not finite.
        """
        rows = np.ascontiguousarray(poses, dtype=self._kind).reshape(-1, STATES)
        pointer = rows.ctypes.data_as(ctypes.POINTER(self._real))
        if self._library.kmpc_set_path(ctypes.byref(self._robot), len(rows), pointer):
            raise ValueError(f"path: expected at most {PATH} finite poses, got {len(rows)}")

    def step(
        self,
        x: ArrayLike,
        goal: ArrayLike,
        obstacles: Sequence[Circle] | ArrayLike = (),
        sent: ArrayLike | None = None,
    ) -> CompiledPlan:
        """Plan from the measured pose; as `Controller.step`, past circles alone.

        Raises
        ------
        ValueError
            For wrong shapes, and for nothing else.
        """
        pose, target, command = step_numbers(x, goal, sent, INPUTS)
        if isinstance(obstacles, Sequence) and any(isinstance(o, PREPARED) for o in obstacles):
            raise ValueError("obstacles: an exported controller drives past circles alone")
        circles = circles_to_array(obstacles)
        rows = np.ascontiguousarray(circles, dtype=self._kind)
        last = None if command is None else np.ascontiguousarray(command, dtype=self._kind)
        pointer = ctypes.POINTER(self._real)
        given = self._input(
            (self._real * STATES)(*pose),
            (self._real * STATES)(*target),
            len(rows),
            rows.ctypes.data_as(pointer),
            None if last is None else last.ctypes.data_as(pointer),
            0,
        )
        plan = self._plan
        self._step(ctypes.byref(self._robot), ctypes.byref(given), ctypes.byref(plan))
        return CompiledPlan(
            np.array(plan.command, dtype=float),
            np.array(plan.states, dtype=float),
            np.array(plan.inputs, dtype=float),
            STATUSES[plan.status],
            plan.passes,
            plan.reason.decode(),
        )


def _read_about(folder: Path) -> dict[str, Any]:
    try:
        about: dict[str, Any] = json.loads((folder / ABOUT).read_text())
    except (OSError, ValueError) as error:
        raise ProblemError(f"{folder}: no exported controller: {ABOUT}: {error}") from error
    if about.get("format") != FORMAT:
        raise ProblemError(
            f"{folder}: expected an export of format {FORMAT}, got {about.get('format')!r}: "
            "export it again"
        )
    return about


def _built(folder: Path) -> Path:
    """Build the library of a folder if that is needed."""
    library = folder / LIBRARY
    newest = max(path.stat().st_mtime for path in folder.rglob("*.[ch]"))
    if library.is_file() and library.stat().st_mtime >= newest:
        return library
    make = shutil.which("make")
    if make is None or shutil.which(os.environ.get("CC", "cc")) is None:
        raise ProblemError(f"{folder}: a C compiler (cc) and make are needed to build {LIBRARY}")
    done = subprocess.run(
        [make, "-s", "-C", str(folder), LIBRARY], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise ProblemError(f"{folder}: make {LIBRARY}: {done.stderr.strip().splitlines()[-1:]}")
    return library


def _load(library: Path) -> ctypes.CDLL:
    """Load a copy: the solver's memory is static, and each controller needs its own."""
    with tempfile.TemporaryDirectory() as folder:
        own = Path(folder) / LIBRARY
        shutil.copy(library, own)
        # what is loaded stays, without its file
        return ctypes.CDLL(str(own))


def _structures(real: Any, horizon: int) -> tuple[Any, Any]:
    """What goes in and comes out of a step, as kmpc.h has it."""
    integer = ctypes.c_int
    pointer = ctypes.POINTER(real)

    def structure(name: str, *fields: tuple[str, Any]) -> Any:
        return type(name, (ctypes.Structure,), {"_fields_": list(fields)})

    given = structure(
        "Input",
        ("pose", real * STATES),
        ("goal", real * STATES),
        ("circles", integer),
        ("circle", pointer),
        ("sent", pointer),
        ("passes", integer),
    )
    plan = structure(
        "Plan",
        ("command", real * INPUTS),
        ("status", integer),
        ("passes", integer),
        ("reason", ctypes.c_char_p),
        ("states", (real * STATES) * (horizon + 1)),
        ("inputs", (real * INPUTS) * horizon),
    )
    return given, plan
