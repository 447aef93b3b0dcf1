"""Every command of every drive to the last bit: for moves and simplifications."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

from outcomes.plant import Array
from outcomes.runner import chosen, drive_all


def _driven(given: argparse.Namespace, names: list[str]) -> dict[str, Array]:
    keys = [(name, 0, 0) for name in names]
    return {
        done.key[0]: done.commands
        for done in drive_all(keys, given.jobs)
        if done.result is not None
    }


def save(given: argparse.Namespace) -> int:
    """Keep every command of every drive, to the last bit."""
    commands = _driven(given, [row.name for row in chosen(given.rows, given.quick)])
    with Path(given.file).open("wb") as file:
        np.savez_compressed(
            file,
            **{f"d{i}": c for i, c in enumerate(commands.values())},
            names=np.array(list(commands)),
        )
    sys.stdout.write(f"{len(commands)} drives kept\n")
    return 0


def same(given: argparse.Namespace) -> int:
    """Say how many drives differ from those of a file, and the first step of each."""
    with np.load(given.file) as kept:
        names = [str(name) for name in kept["names"]]
        before = {name: kept[f"d{i}"] for i, name in enumerate(names)}
    wanted = [row.name for row in chosen(given.rows, given.quick) if row.name in before]
    now, differ = _driven(given, wanted), 0
    for name, commands in now.items():
        step = first_difference(before[name], commands)
        if step is not None:
            differ += 1
            sys.stdout.write(f"{name}: differs from step {step} on\n")
    sys.stdout.write(f"{differ} of {len(now)} drives differ\n")
    return 1 if differ else 0


def first_difference(one: Array, other: Array) -> int | None:
    """First step at which commands (T, 2) are not the same bits; None if all are."""
    count = min(len(one), len(other))
    bits = [np.ascontiguousarray(c[:count]).view(np.int64) for c in (one, other)]
    differ = np.flatnonzero((bits[0] != bits[1]).any(axis=1))
    if len(differ):
        return int(differ[0])
    return None if len(one) == len(other) else count
