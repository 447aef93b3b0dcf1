"""What a model file says of its making: which vehicle, how fast it drove, how it stops.

`kmpc run` reads it before the first drive with the model.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import closing
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.coverage import measure_stopping
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.formats.readers import find_logs
from kmpc_lite.model.file import is_vehicle
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.reading import text_lines
from kmpc_lite.types import INPUTS

REMARK, LONGEST = "# vehicle ", 4096
"""What a log's first line begins with where its recorder knew the vehicle, JSON follows; characters
of the longest such line."""
ROLLS = 1e-3
"""Speed below which a command tells no curvature [m/s]."""
SHOWN = 0.5
"""A speed counts as driven where the log holds it, or more, for so long [s]."""


def describe_making(
    model: KoopmanModel,
    logs: Sequence[Path],
    data: Dataset,
    vehicle: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Values for a model's `info`, which JSON can hold.

    `model`: what was learned. `logs`: from which files. `data`: the whole log, with what the model
    was checked on. `vehicle`: what the log, or the user, says of the vehicle.
    """
    made: dict[str, Any] = {
        "log": [str(file) for file in logs],
        "driven": driven_speeds(data),
        "stopping": measure_stopping(model, data).as_dict(),
        "wheels": describe_wheels(data),
    }
    more = {"steered": data.steered, "geometry": data.geometry, "vehicle": dict(vehicle or {})}
    return {**made, **{name: value for name, value in more.items() if value}}


def describe_wheels(data: Dataset) -> dict[str, Any]:
    """Kind of the wheels that a log is of, as `read_wheels` takes it; a car's sharpest turn."""
    if data.commands > INPUTS:
        return {"kind": "omni"}
    if not data.steered:
        return {"kind": "differential"}
    v, omega = data.inputs[np.abs(data.inputs[:, 0]) > ROLLS].T
    sharpest = float(np.max(np.abs(omega / v), initial=0.0))
    radius = {"turning_radius": round(1.0 / sharpest, 6)} if sharpest > 0.0 else {}
    return {"kind": "car", **radius}


def driven_speeds(data: Dataset) -> dict[str, float]:
    """Largest speeds forward and back [m/s] and turn rate [rad/s] that a log shows for a while.

    Of an omni to its sides, too.
    """
    rows = min(data.steps, max(1, ceil(SHOWN / data.dt)))
    v, *aside, omega = data.inputs.T
    shown = {"forward": v, "reverse": -v, "turn": np.abs(omega)}
    if aside:
        shown["sideways"] = np.abs(aside[0])
    return {name: max(0.0, float(np.sort(values)[-rows])) for name, values in shown.items()}


def read_vehicle(files: Sequence[Path], name: str | None = None) -> dict[str, Any] | None:
    """What logs say of their vehicle; None if none of them says anything.

    `files`: logs of any kind, and folders; tables of text may begin with a remark on the vehicle.
    `name`: name of the vehicle, which goes before the logs' own. Raises DataError if two logs are
    of different vehicles.
    """
    found: dict[str, Any] = {}
    first = None
    for file in find_logs(files):
        if (said := _remark(file)) is None:
            continue
        if first is not None and (different := differences(found, said)):
            raise DataError(
                f"{file}: of another vehicle than {first}: {'; '.join(different)}; one model is "
                "learned from logs of one vehicle"
            )
        first, found = first or file, {**said, **found}
    return {**found, **({} if name is None else {"name": name})} or None


def differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """What differs between two vehicles, in words; what only one of them says does not count."""
    return [
        f"{key} {one[key]} and {other[key]}"
        for key in one
        if key in other and not _same(one[key], other[key])
    ]


def _same(one: Any, other: Any) -> bool:
    """Whether two values are the same; numbers to a thousandth."""
    if isinstance(one, int | float) and isinstance(other, int | float):
        return abs(one - other) <= 1e-3 * max(abs(one), abs(other))
    return bool(one == other)


def _remark(file: Path) -> dict[str, Any] | None:
    """The remark at the beginning of a table of text, if there is one."""
    if file.suffix.lower() not in (".csv", ".tsv", ".txt"):
        return None
    with closing(text_lines(file, LONGEST)) as lines:
        try:
            first = next(lines, "")
        except (OSError, ValueError):  # whoever reads the log says what is wrong with it
            return None
    if not first.startswith(REMARK):
        return None
    try:
        said = json.loads(first.removeprefix(REMARK))
    except (ValueError, RecursionError) as error:
        raise DataError(f"{file}: line 1: the remark on the vehicle is no JSON: {error}") from error
    if not is_vehicle(said):
        raise DataError(f"{file}: line 1: the remark on the vehicle is no table of plain values")
    return dict(said)
