"""Drives that failed, as scenario files that replay them, beside the models that were driven."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.studies.conditions import Condition
from kmpc_lab.studies.records import Record
from kmpc_lite.model.koopman import KoopmanModel


class Driven(Protocol):
    """What a failure's file tells of the controller that drove."""

    @property
    def simulate_words(self) -> tuple[str, ...] | None:
        """What makes ``kmpc simulate`` drive this controller; None if no option does."""
        ...


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
    drives: Iterable[tuple[Record, Driven, Condition, KoopmanModel]], folder: str | Path
) -> list[Path]:
    """Write a scenario file for every drive, and the model that was driven.

    The first line of each file says how to drive it again, or that ``kmpc simulate`` cannot.
    """
    target = Path(folder)
    paths = []
    for record, spec, condition, model in drives:
        scenario = condition.apply(random_map(record["family"], record["seed"], record["slip"]))
        what = "collision" if record["collision_s"] is not None else "not there"
        target.mkdir(parents=True, exist_ok=True)
        trained = "nominal" if record["trained_at"] is None else f"{record['trained_at']:g}"
        learned = _file_name("model", record["condition"], trained, model.info["method"]) + ".npz"
        if not (target / learned).exists():
            model.save(target / learned)
        name = f"{scenario.name}-slip{record['slip']:g}-{_file_name(record['controller'])}.toml"
        again = _again(spec, name, learned)
        (target / name).write_text(
            f"# {record['controller']}: {what}; {again}\n{scenario.to_toml()}", encoding="utf-8"
        )
        paths.append(target / name)
    return paths


def _again(spec: Driven, scenario: str, model: str) -> str:
    """How a drive of a controller on a scenario file with a model's file is driven again."""
    words = spec.simulate_words
    if words is None:
        return "cannot be driven again by kmpc simulate"
    return " ".join(["kmpc simulate --scenario", scenario, "--model", model, *words])


def _file_name(*words: str) -> str:
    """Words as a part of a file's name."""
    return "-".join("".join(c if c.isalnum() or c == "." else " " for c in " ".join(words)).split())
