"""The file of recorded drives, and how answers are compared with those in it."""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import kmpc_lite as kl

Array = NDArray[np.float64]

FILE = Path(__file__).with_name("drives.npz")
FRACTION = 2.0**34
"""Answers are kept to multiples of its inverse, 6e-11: what is left out compresses badly."""
TOLERANCE = 1e-9
"""How far an answer may be from the recorded one, relative to numbers of order one."""
STATE_SUMS, INPUT_SUMS = 6, 4
"""How many fixed random sums of a plan's states, and of its commands, stand for all of them."""
STATUSES = ("SOLVED", "FEASIBLE", "FALLBACK", "STOPPED")
COLUMNS = (
    "v",
    "omega",
    *(f"states {i}" for i in range(STATE_SUMS)),
    *(f"inputs {i}" for i in range(INPUT_SUMS)),
    "clearance",
)
CODES = ("status", "holding", "reachable", "iterations")


@dataclass(frozen=True, eq=False)
class Drive:
    """One recorded drive of T steps."""

    number: int
    setup: dict[str, Any]
    """Kind, model, problem, options, events by step."""
    poses: Array
    """(T, 3) as given."""
    sent: Array
    """(T, 2) as given; infinity where it was not."""
    clock: Array
    """(T,) the clock's time when a step begins [s]."""
    values: Array
    """(T, len(COLUMNS)) numbers of the answers."""
    codes: NDArray[np.uint8]
    """(T, len(CODES))."""


def rounded(values: Array) -> Array:
    """Values as they are kept."""
    return np.round(values * FRACTION) / FRACTION


def deviation(drive: Drive, values: Array) -> Array:
    """Distances (T, len(COLUMNS)) from the recorded answers, relative where numbers are large."""
    same = (values == drive.values) | (np.isnan(values) & np.isnan(drive.values))
    with np.errstate(invalid="ignore"):
        off = np.abs(values - drive.values) / np.maximum(np.abs(drive.values), 1.0)
    return np.where(same, 0.0, np.where(np.isfinite(off), off, np.inf))


def first_difference(
    drive: Drive, values: Array, codes: NDArray[np.uint8]
) -> tuple[int, str] | None:
    """The first step that is not as recorded, and what is wrong with it; none where all is."""
    off = deviation(drive, values)
    wrong = (off > TOLERANCE).any(axis=1) | (codes != drive.codes).any(axis=1)
    if not wrong.any():
        return None
    k = int(np.argmax(wrong))
    parts = [
        f"{c} {int(a)} -> {int(b)}"
        for c, a, b in zip(CODES, drive.codes[k], codes[k], strict=True)
        if a != b
    ]
    worst = int(np.argmax(off[k]))
    if off[k, worst] > TOLERANCE:
        parts.append(f"{COLUMNS[worst]} {drive.values[k, worst]:.12g} -> {values[k, worst]:.12g}")
    return k, ", ".join(parts)


def save(
    path: Path, models: list[kl.KoopmanModel], drives: list[Drive], about: dict[str, Any]
) -> None:
    """Write the file, whole or not at all."""
    arrays: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for i, model in enumerate(models):
            model.save(Path(folder) / "model.npz")
            arrays[f"model_{i}"] = np.frombuffer(
                (Path(folder) / "model.npz").read_bytes(), dtype=np.uint8
            )
    text = json.dumps({"about": about, "setups": [d.setup for d in drives]}, separators=(",", ":"))
    arrays["text"] = np.frombuffer(text.encode(), dtype=np.uint8)
    arrays["lengths"] = np.array([len(d.poses) for d in drives])
    for name in ("poses", "sent", "clock", "values", "codes"):
        # columns one after the other, and bytes of the same weight side by side, compress best
        whole = np.ascontiguousarray(np.concatenate([getattr(d, name) for d in drives]).T)
        arrays[name] = whole.view(np.uint8).reshape(-1, whole.itemsize).T.copy()
    part = path.with_name(path.name + ".part.npz")
    np.savez_compressed(part, **arrays)
    part.replace(path)


def load(path: Path = FILE) -> tuple[list[kl.KoopmanModel], list[Drive], dict[str, Any]]:
    """Read models, drives, and what the file tells about itself."""
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    models = []
    with tempfile.TemporaryDirectory() as folder:
        for i in range(sum(name.startswith("model_") for name in arrays)):
            (Path(folder) / "model.npz").write_bytes(arrays[f"model_{i}"].tobytes())
            models.append(kl.KoopmanModel.load(Path(folder) / "model.npz"))
    text = json.loads(arrays["text"].tobytes())
    lengths = arrays["lengths"]
    widths = {
        "poses": (3,),
        "sent": (2,),
        "clock": (),
        "values": (len(COLUMNS),),
        "codes": (len(CODES),),
    }
    parts: dict[str, list[Any]] = {}
    for name, width in widths.items():
        kind = np.uint8 if name == "codes" else np.float64
        whole = (
            np.ascontiguousarray(arrays[name].T).view(kind).reshape(*width, int(lengths.sum())).T
        )
        parts[name] = np.split(np.ascontiguousarray(whole), np.cumsum(lengths)[:-1])
    rows = zip(text["setups"], *(parts[name] for name in widths), strict=True)
    return models, [Drive(i, *row) for i, row in enumerate(rows)], text["about"]
