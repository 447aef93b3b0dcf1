"""Runs as pictures: what is drawn of them, and the file."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lab.report.moments import clearance_words, outcome_title, path_clearances, substeps
from kmpc_lab.report.picture import Trace, drive_picture
from kmpc_lab.report.style import render, write_picture
from kmpc_lab.sim.closed_loop import Outcome, Run
from kmpc_lite.errors import KmpcError


def draw_drives(file: Path, drives: Mapping[str, Run]) -> None:
    """Write a picture of one or several drives on one map, .png or .svg.

    `drives`: by the names that they have in the picture. Raises KmpcError if matplotlib is missing,
    for drives of different maps, or if the file cannot be written.
    """
    check_one_map(drives)
    run = next(iter(drives.values()))
    title = f"{outcome_title(run)}, {clearance_words(run)}"
    if len(drives) > 1:
        title = f"{len(drives)} drives, {run.scenario.name}"
    named = {
        f"{name}: {one.outcome.value} after {one.duration:.4g} s, {clearance_words(one)}": one
        for name, one in drives.items()
    }
    figure = drive_picture({name: trace_of(one) for name, one in named.items()}, title)
    write_picture(file, render(figure, "svg" if file.suffix.lower() == ".svg" else "png"))


def trace_of(run: Run, u_min: ArrayLike | None = None, u_max: ArrayLike | None = None) -> Trace:
    """What a picture shows of a run; `limits` says where limits come from if not given."""
    scenario, looks, count = run.scenario, substeps(run), len(run.path)
    if run.outcome is Outcome.COLLISION:
        count = min(1 + round(run.duration / run.dt * looks), count)
    solids = () if scenario.solids is None else scenario.solids.solids
    return Trace(
        run.path[:count],
        run.inputs,
        run.statuses,
        np.array(scenario.goal),
        scenario.footprint or scenario.radius,
        (*scenario.circles, *solids),
        run.dt,
        looks,
        path_clearances(run)[:count],
        run.step_times,
        limits(run, u_min, u_max),
        scenario.bounds,
    )


def limits(run: Run, u_min: ArrayLike | None, u_max: ArrayLike | None) -> tuple[Any, Any]:
    """Command limits (2,) each, or None.

    Those given come first, else what the run keeps as ``info["u_min"]`` and ``info["u_max"]``.

    Raises KmpcError for limits that are not two numbers.
    """
    found: list[Any] = []
    for name, given in (("u_min", u_min), ("u_max", u_max)):
        value = run.info.get(name) if given is None else given
        try:
            array = None if value is None else np.asarray(value, dtype=float)
        except (TypeError, ValueError) as error:
            raise KmpcError(f"{name}: expected two numbers, got {value!r}") from error
        if array is not None and (array.shape != (2,) or not np.isfinite(array).all()):
            raise KmpcError(f"{name}: expected two numbers, got {value!r}")
        found.append(array)
    return found[0], found[1]


def check_one_map(drives: Mapping[str, Run]) -> None:
    """Raise KmpcError for drives of different maps."""
    (first, run), *others = drives.items()
    for name, other in others:
        if _map_of(other) != _map_of(run):
            raise KmpcError(
                f"{name}: has another map ({other.scenario.name}) than {first} "
                f"({run.scenario.name}): expected drives on one map"
            )


def _map_of(run: Run) -> tuple[object, ...]:
    names = ("bounds", "circles", "polygons", "walls", "grid", "goal", "footprint", "radius")
    return tuple(getattr(run.scenario, name) for name in names)
