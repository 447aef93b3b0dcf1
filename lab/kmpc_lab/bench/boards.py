"""Step times of several boards side by side, from what `kmpc bench --json` wrote on each."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from kmpc_lite import __version__
from kmpc_lite.errors import DataError
from kmpc_lite.reading import read_bytes

MODEL = Path("/proc/device-tree/model")
"""Where a board with a device tree, such as a Raspberry Pi, says what it is."""
LARGEST = 2**20
"""Of a file [bytes]."""


class Board(NamedTuple):
    """What was measured on one board."""

    name: str
    machine: str
    """Architecture, cores, versions, in words."""
    steps: dict[str, dict[str, float]]
    """By contender: p50 and p99 of its steps [ms], and others."""


def this_machine() -> dict[str, Any]:
    """Say on what a benchmark runs, as values that JSON can hold."""
    return {
        "name": _name(),
        "architecture": platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "kmpc_lite": __version__,
    }


def _name() -> str:
    """Name of the board, or of its processor."""
    if MODEL.exists():
        return MODEL.read_text().rstrip("\0\n")
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()


def read_board(file: Path) -> Board:
    """Read what `kmpc bench --json` wrote.

    Raises DataError if that is something else.
    """
    try:
        told = json.loads(read_bytes(file, LARGEST))
        machine = told["machine"]
        parts = (
            f"{machine['architecture']}, {machine['cores']} cores",
            f"Python {machine['python']}, kmpc_lite {machine['kmpc_lite']}",
        )
        rows = [row for table in told["tables"].values() for row in table]
        steps = {str(row["name"]): {k: float(v) for k, v in row["ms"].items()} for row in rows}
        return Board(str(machine["name"]), ", ".join(parts), steps)
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise DataError(f"{file}: expected what kmpc bench --json writes ({error})") from error


def format_boards(boards: Sequence[Board]) -> str:
    """Put boards side by side, in a table of Markdown: median and 99 % quantile of a step [ms]."""
    names = list(dict.fromkeys(name for board in boards for name in board.steps))
    lines = [
        "| step [ms], p50 / p99 | " + " | ".join(board.name for board in boards) + " |",
        "|---" * (len(boards) + 1) + "|",
        "| | " + " | ".join(board.machine for board in boards) + " |",
    ]
    for name in names:
        cells = [_cell(board.steps.get(name)) for board in boards]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _cell(ms: dict[str, float] | None) -> str:
    return "-" if ms is None else f"{ms['p50']:.3g} / {ms['p99']:.3g}"
