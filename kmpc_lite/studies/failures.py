"""Drives that failed, as scenario files that replay them, beside the models that were driven."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable
from pathlib import Path

from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.sim.maps.families import random_map
from kmpc_lite.studies.conditions import Condition
from kmpc_lite.studies.records import Record


def failed(record: Record) -> bool:
    """Whether a drive collided, or never came to the goal's pose."""
    return record["collision_s"] is not None or record["pose_s"] is None


def check_folder(folder: str | Path) -> None:
    """Raise OSError where a folder cannot be made or written to, before hours of driving."""
    place = Path(folder).absolute()
    while not place.exists():
        place = place.parent
    if not place.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(place))
    if not os.access(place, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(place))


def write_failures(
    drives: Iterable[tuple[Record, Condition, KoopmanModel]], folder: str | Path
) -> list[Path]:
    """Write a scenario file for every drive, and the model that was driven.

    The first line of each file says how to drive it again.
    """
    target = Path(folder)
    paths = []
    for record, condition, model in drives:
        scenario = condition.apply(random_map(record["family"], record["seed"], record["slip"]))
        what = "collision" if record["collision_s"] is not None else "not there"
        target.mkdir(parents=True, exist_ok=True)
        trained = "nominal" if record["trained_at"] is None else f"{record['trained_at']:g}"
        learned = _file_name("model", record["condition"], trained, model.info["method"]) + ".npz"
        if not (target / learned).exists():
            model.save(target / learned)
        name = f"{scenario.name}-slip{record['slip']:g}-{_file_name(record['controller'])}.toml"
        switch = " --no-adaptation" if "no adaptation" in record["controller"] else ""
        (target / name).write_text(
            f"# {record['controller']}: {what}; kmpc simulate --scenario {name} "
            f"--model {learned}{switch}\n{scenario.to_toml()}",
            encoding="utf-8",
        )
        paths.append(target / name)
    return paths


def _file_name(*words: str) -> str:
    """Words as a part of a file's name."""
    return "-".join("".join(c if c.isalnum() or c == "." else " " for c in " ".join(words)).split())
