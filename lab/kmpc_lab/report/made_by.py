"""What made a report: commands, versions and the machine."""

from __future__ import annotations

import os
import platform
import sys
from collections.abc import Iterable
from importlib import metadata
from pathlib import Path

from kmpc_lab.sim.closed_loop import Run


def made_rows(run: Run, command: str | None) -> Iterable[tuple[str, str]]:
    """Rows of a name and a value."""
    driven = run.info.get("command")
    if driven not in (None, command):
        yield "Driven by", str(driven)
    if command is not None:
        yield "Command", command
    yield "Python", platform.python_version()
    for name in ("kmpc-lite", "numpy", "scipy", "osqp", "matplotlib"):
        yield name, _version(name)
    yield (
        "Machine",
        ", ".join(
            part
            for part in (
                _processor(),
                platform.machine(),
                f"{os.cpu_count() or '?'} cores",
                sys.platform,
            )
            if part
        ),
    )


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"


def _processor() -> str:
    """Name of the board or the processor, where the system tells it."""
    for source, key in (("/proc/device-tree/model", ""), ("/proc/cpuinfo", "model name")):
        file = Path(source)
        if file.is_file():
            text = file.read_text(encoding="utf-8", errors="replace").strip("\0\n ")
            lines = [
                line.partition(":")[2].strip() if key else line
                for line in text.splitlines()
                if line.startswith(key)
            ]
            if lines:
                return lines[0]
    return platform.processor()
