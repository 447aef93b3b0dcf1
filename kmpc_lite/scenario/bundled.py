"""The scenarios that are installed, by name; importing this file does not import NumPy."""

from __future__ import annotations

from importlib import metadata, resources
from pathlib import Path

ENTRY_POINTS = "kmpc.scenarios"  # packages of other distributions that hold scenario files


def bundled() -> list[str]:
    """Names of the scenarios that are installed."""
    return sorted(_files())


def bundled_file(name: str) -> Path:
    """Path of one of them."""
    return _files()[name]


def _files() -> dict[str, Path]:
    others = [point.value for point in metadata.entry_points(group=ENTRY_POINTS)]
    folders = [Path(str(resources.files(name))) for name in others]
    folders.append(Path(str(resources.files("kmpc_lite.scenario"))) / "bundled_files")
    return {path.stem: path for folder in folders for path in folder.glob("*.toml")}
