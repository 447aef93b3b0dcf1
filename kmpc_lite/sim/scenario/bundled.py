"""The scenarios that come with the package, by name; importing this file does not import NumPy."""

from __future__ import annotations

from importlib import resources
from pathlib import Path


def bundled() -> list[str]:
    """Names of the scenarios that come with the package."""
    return sorted(path.stem for path in _folder().iterdir() if path.suffix == ".toml")


def bundled_file(name: str) -> Path:
    """Path of one of them."""
    return _folder() / f"{name}.toml"


def _folder() -> Path:
    return Path(str(resources.files("kmpc_lite.sim"))) / "scenarios"
