"""Change one number of the controller after the other, and tell which changes no drive sees.

Every number of a module constant, of a dataclass's default and of an argument's default is changed
in a copy of the package, and the drives are replayed with it until one differs. A number whose
change nobody sees is not watched by the golden drives.
"""

from __future__ import annotations

import argparse
import ast
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
REPLAY = Path(__file__).with_name("replay.py")
HUNG = 600.0
"""A replay that takes longer is stopped, and counts as one that differs [s]."""


class Number(NamedTuple):
    """A number in the source."""

    file: Path
    name: str
    line: int
    begin: int
    end: int
    value: float

    def __str__(self) -> str:
        where = f"{self.file.relative_to(ROOT)}:{self.line}"
        return f"{where} {self.name} = {self.value:g}"


def numbers(file: Path) -> Iterator[Number]:
    """All numbers of a file that stand for an option."""
    for name, value in _options(ast.parse(file.read_text(encoding="utf-8"))):
        for leaf in ast.walk(value):
            number = leaf.value if isinstance(leaf, ast.Constant) else None
            # ast.Constant also holds strings, and True is an int
            if isinstance(leaf, ast.Constant) and type(number) in (int, float):
                end = leaf.end_col_offset or leaf.col_offset
                yield Number(file, name, leaf.lineno, leaf.col_offset, end, number)


def _options(tree: ast.Module) -> Iterator[tuple[str, ast.expr]]:
    """Names and values of constants, class fields and default arguments."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef):
            for part in node.body:
                if isinstance(part, ast.Assign):
                    yield f"{getattr(node, 'name', '')}.{ast.unparse(part.targets[0])}", part.value
                elif isinstance(part, ast.AnnAssign) and part.value is not None:
                    yield f"{getattr(node, 'name', '')}.{ast.unparse(part.target)}", part.value
        elif isinstance(node, ast.FunctionDef):
            given = node.args
            late = given.args[len(given.args) - len(given.defaults) :]
            pairs = [*zip(late, given.defaults, strict=True)]
            pairs += [
                (argument, default)
                for argument, default in zip(given.kwonlyargs, given.kw_defaults, strict=True)
                if default is not None
            ]
            for argument, default in pairs:
                yield f"{node.name}({argument.arg})", default


def changed(number: Number, factor: float) -> str:
    """The file's text with another number."""
    lines = number.file.read_text(encoding="utf-8").splitlines(keepends=True)
    line = lines[number.line - 1].encode()
    whole = isinstance(number.value, int)
    other = number.value + 1 if whole else number.value * factor if number.value else 0.1
    text = line[: number.begin] + repr(other).encode() + line[number.end :]
    lines[number.line - 1] = text.decode()
    return "".join(lines)


def replay(number: Number, factor: float, every: bool) -> str:
    """What a replay with the changed number says; empty where no drive differs."""
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / "kmpc_lite", Path(folder) / "kmpc_lite")
        copy = Path(folder) / number.file.relative_to(ROOT)
        copy.write_text(changed(number, factor), encoding="utf-8")
        where = {**os.environ, "PYTHONPATH": folder, "PYTHONDONTWRITEBYTECODE": "1"}
        command = [sys.executable, str(REPLAY), "-q", *([] if every else ["-x"])]
        try:
            done = subprocess.run(
                command, env=where, capture_output=True, text=True, timeout=HUNG, check=False
            )
        except subprocess.TimeoutExpired:
            return f"stopped after {HUNG:g} s"
    if done.returncode == 0:
        return ""
    if done.returncode < 0:
        return f"the replay was ended by signal {-done.returncode}: try this one again"
    found = re.findall(r"^ *(\d+) (.{42})(.*)$", done.stdout, flags=re.MULTILINE)
    if not found:
        return f"no replay: {done.stderr.strip().splitlines()[-1:]}"
    if every:
        return f"{len(found)} drives: {' '.join(row[0] for row in found)}"
    return f"drive {found[0][0]} ({found[0][1].strip()}){found[0][2]}"


def main() -> int:
    """Change the numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    default = [ROOT / "kmpc_lite" / "control"]
    parser.add_argument("paths", type=Path, nargs="*", default=default, help="files and folders")
    parser.add_argument("--name", default="", help="only options whose name has this text in it")
    parser.add_argument("--factor", type=float, default=1.2, help="of numbers that are not whole")
    parser.add_argument("--every", action="store_true", help="list all drives that differ")
    parser.add_argument("--list", action="store_true", help="show the numbers, change none")
    given = parser.parse_args()
    files = [f for p in given.paths for f in (sorted(p.rglob("*.py")) if p.is_dir() else [p])]
    chosen = [n for f in files for n in numbers(f.resolve()) if given.name in n.name]
    unseen = []
    for number in chosen:
        said = "" if given.list else replay(number, given.factor, given.every)
        if not said and not given.list:
            unseen.append(number)
        sys.stdout.write(f"{number}: {said or ('' if given.list else 'NOT SEEN')}\n")
        sys.stdout.flush()
    sys.stdout.write(f"{len(unseen)} of {len(chosen)} changes are seen by no drive\n")
    return 1 if unseen else 0


if __name__ == "__main__":
    sys.exit(main())
