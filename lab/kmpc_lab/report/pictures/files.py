"""All pictures of a run, and the files that hold them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from kmpc_lab.report.maps import map_picture
from kmpc_lab.report.pictures.beside import beside_picture
from kmpc_lab.report.pictures.commands import commands_picture
from kmpc_lab.report.pictures.errors import errors_picture
from kmpc_lab.report.pictures.fit import fit_picture
from kmpc_lab.report.pictures.timing import timing_picture
from kmpc_lab.report.style import render, write_picture
from kmpc_lab.sim.closed_loop import Run
from kmpc_lite.errors import KmpcError
from kmpc_lite.learn.evaluation import FitReport

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def run_pictures(
    run: Run, fit_report: FitReport | None, u_min: ArrayLike | None, u_max: ArrayLike | None
) -> dict[str, Figure]:
    """Give every picture of a run by its name."""
    found = {
        "map": map_picture(run),
        "commands": commands_picture(run, u_min, u_max),
        "errors": errors_picture(run),
        "timing": timing_picture(run),
    }
    return found if fit_report is None else {**found, "fit": fit_picture(fit_report)}


def write_beside(folder: Path, runs: Sequence[Run], files: Sequence[Path]) -> Path:
    """Write a picture of several drives, labelled by their files' names, into a folder.

    Raises KmpcError for drives of different maps, or where it cannot be written.
    """
    picture, path = beside_picture(runs, [file.stem for file in files]), folder / "beside.png"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        picture.savefig(path, dpi=150)
    except OSError as error:
        raise KmpcError(f"{path}: cannot write the picture: {error.strerror or error}") from error
    return path


def write_pictures(
    folder: str | Path,
    run: Run,
    fit_report: FitReport | None = None,
    *,
    u_min: ArrayLike | None = None,
    u_max: ArrayLike | None = None,
) -> list[Path]:
    """Write the pictures of a run as PNG files.

    These are ``map.png``, ``commands.png``, ``errors.png``, ``timing.png`` and, with a fit
    report, ``fit.png``.

    Parameters
    ----------
    folder : path
        Made where missing.
    run : Run
        What was driven.
    fit_report : FitReport, optional
        Held-out errors of its model.
    u_min, u_max : array_like, optional
        Command limits (2,) [m/s, rad/s]; what the run keeps in its `info` if not given.

    Returns
    -------
    list of Path
        The files written, 150 dots per inch.

    Raises
    ------
    KmpcError
        If matplotlib is missing or a file cannot be written.
    """
    target = Path(folder)
    pictures = run_pictures(run, fit_report, u_min, u_max)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise KmpcError(f"{target}: cannot make the folder: {error.strerror or error}") from error
    paths = [target / f"{name}.png" for name in pictures]
    for path, figure in zip(paths, pictures.values(), strict=True):
        write_picture(path, render(figure, "png"))
    return paths
