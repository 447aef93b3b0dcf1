"""Optional dependencies: told by name, with the line that installs them, before any work begins."""

from __future__ import annotations

from importlib.util import find_spec

from kmpc_lite.errors import KmpcError

EXTRAS = {
    "PIL": "plot",
    "casadi": "peers",
    "jinja2": "plot",
    "foxglove": "live",
    "matplotlib": "plot",
    "mujoco": "twin",
    "pymavlink": "bridge",
    "pyulog": "logs",
    "rosbags": "logs",
    "shtab": "completion",
    "zenoh": "ros2",
}
"""Extra of pyproject.toml that brings a module."""


class MissingExtra(KmpcError):
    """An optional dependency is not installed."""


def is_installed(module: str) -> bool:
    """Whether a module can be imported; it is not."""
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):
        return False


def need(what: str, *modules: str) -> None:
    """Refuse where a module is missing.

    Parameters
    ----------
    what : str
        Which needs it: "a report".
    modules : str
        Names of `EXTRAS`.

    Raises
    ------
    MissingExtra
        With the line that installs it.
    """
    for module in modules:
        if not is_installed(module):
            raise MissingExtra(f"{what} needs {module}: {pip_line(module)}")


def missing_extra(error: ModuleNotFoundError) -> str | None:
    """What to say of a module that was not found; None where it belongs to no extra."""
    module = (error.name or "").partition(".")[0]
    return f"{module} is not installed: {pip_line(module)}" if module in EXTRAS else None


def pip_line(module: str) -> str:
    """Command that installs the extra of a module."""
    return f"pip install 'kmpc-lite[{EXTRAS[module]}]'"
