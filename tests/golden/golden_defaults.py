"""A copy of the package in which one option has another default."""

from __future__ import annotations

import ast
import dataclasses
import math
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from kmpc_lite.control.options import ControllerOptions

PACKAGE = Path(__file__).parents[2] / "kmpc_lite"
ADAPTATION = "adaptation"


def defaults() -> dict[str, Any]:
    """Names of all options, with their rooms, and their values."""
    return dict(_fields(ControllerOptions()))


def _fields(options: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    for field in dataclasses.fields(options):
        value = getattr(options, field.name)
        if dataclasses.is_dataclass(value):
            yield from _fields(value, (*path, field.name))
        else:
            yield ".".join((*path, field.name)), value


def changed(value: Any) -> Any:
    """Change a value by 20 %."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return max(math.ceil(1.2 * value), value + 1)
    if isinstance(value, tuple):
        return tuple(1.2 * part for part in value)
    return 1.2 * value or 0.2


def copy_with(option: str, value: Any, folder: Path) -> None:
    """Write the package below a folder, with another value as an option's default."""
    copy = folder / PACKAGE.name
    if not copy.exists():
        shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    room, *path = option.split(".")
    place = "adaptation/options.py" if room == ADAPTATION else f"control/options/{room}.py"
    source = (PACKAGE / place).read_text(encoding="utf-8")
    (copy / place).write_text(_with_default(source, path, value), encoding="utf-8")


def _with_default(source: str, path: list[str], value: Any) -> str:
    """A file of options with another default of one of them."""
    (given,) = (
        node.value
        for part in ast.parse(source).body
        if isinstance(part, ast.ClassDef)
        for node in part.body
        if isinstance(node, ast.AnnAssign) and ast.unparse(node.target) == path[0]
    )
    assert given is not None
    texts = [repr(v) for v in value] if isinstance(value, tuple) else [repr(value)]
    parts: list[ast.expr] = [given]
    if len(path) > 1:
        # of a group that is made with values of its own
        parts = [
            k.value for k in ast.walk(given) if isinstance(k, ast.keyword) and k.arg == path[1]
        ]
    elif isinstance(given, ast.Call):
        parts = given.args
    lines = source.encode().splitlines(keepends=True)
    first, last = (parts[0], parts[-1]) if parts else (given, given)
    begin = sum(map(len, lines[: first.lineno - 1])) + first.col_offset
    assert last.end_lineno is not None and last.end_col_offset is not None
    end = sum(map(len, lines[: last.end_lineno - 1])) + last.end_col_offset
    if not parts:
        # of a group that is made without values of its own: group(Options())
        assert source.encode()[begin:end].endswith(b"())")
        begin = end = end - 2
        texts = [f"{path[1]}={texts[0]}"]
    whole = source.encode()
    return (whole[:begin] + ", ".join(texts).encode() + whole[end:]).decode()
