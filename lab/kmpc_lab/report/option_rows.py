"""Options of the controller that a run changed, as rows of a name and a value."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from kmpc_lab.sim.closed_loop import Run
from kmpc_lite.control.options import ControllerOptions


def option_rows(run: Run) -> Iterable[tuple[str, str]]:
    """Options that are not the usual ones, with the usual ones beside them."""
    changed = run.info.get("options", run.scenario.options.changed())
    if isinstance(changed, Mapping):
        yield from _rows("", changed, ControllerOptions())


def _rows(where: str, changed: Mapping[str, Any], usual: Any) -> Iterable[tuple[str, str]]:
    """Rows of a table and of the tables in it."""
    for name, value in changed.items():
        before = getattr(usual, name, None)
        if isinstance(value, Mapping):
            yield from _rows(f"{where}{name}.", value, before)
            continue
        yield f"Option {where}{name}", f"{_told(value)}, usually {_told(before)}"


def _told(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(_told(each) for each in value)}]"
    number = isinstance(value, float)
    return f"{value:g}" if number else str(value)
