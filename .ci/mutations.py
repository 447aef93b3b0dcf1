"""Mutate chosen lines, one at a time, in a copy of the tree, and see that a test turns red.

`make mutations` runs it: the lines stand in `.ci/mutations.toml`. Status 1 where a mutant lives, or
where a line is not there once.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from sysconfig import get_path
from typing import Any

ROOT = Path(__file__).parents[1]
JOBS = 2
KERNELS = Path("kmpc_lite/control/kernels")


def copied(folder: Path) -> Path:
    """Copy what the repository holds, and the library that was built of it."""
    told = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True)
    built = [path.relative_to(ROOT) for path in (ROOT / KERNELS).glob("*.so")]
    for name in (*told.stdout.splitlines(), *built):
        if (ROOT / name).is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, folder / name)
    return folder


def lives(line: dict[str, Any], tree: Path) -> str:
    """Say what is wrong with a line: nothing if its mutant is found."""
    path = tree / line["file"]
    text = path.read_text()
    if text.count(line["old"]) != 1:
        return "is not there once"
    path.write_text(text.replace(line["old"], line["new"]))
    try:
        if path.suffix == ".c":
            build(tree)
        done = run(tree, "-m", "pytest", "-x", "-q", "-m", "not long", *line["tests"].split())
    finally:
        path.write_text(text)
        if path.suffix == ".c":
            build(tree)
    return {0: "lives", 1: ""}.get(done.returncode, f"pytest ended with {done.returncode}")


def build(tree: Path) -> None:
    """Build the library of a copy of the tree, as `pip install` does."""
    sources = sorted(str(path) for path in (tree / KERNELS / "c").glob("*.c"))
    (library,) = (tree / KERNELS).glob("*.so")
    flags = ("-std=c99", "-shared", "-fPIC", "-O2", "-I" + get_path("include"))
    subprocess.run(["cc", *flags, *sources, "-o", str(library), "-lm"], check=True)


def run(tree: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a copy of the tree, which comes before what is installed."""
    paths = os.pathsep.join((str(tree), str(tree / "lab")))
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    environment = {**os.environ, **threads, "PYTHONPATH": paths}
    command = [sys.executable, *words]
    return subprocess.run(
        command, cwd=tree, env=environment, capture_output=True, text=True, check=False
    )


def main() -> int:
    """Try every line; status 1 if a mutant lives."""
    lines = tomllib.loads((ROOT / ".ci" / "mutations.toml").read_text())["line"]
    trees: SimpleQueue[Path] = SimpleQueue()

    def tried(line: dict[str, Any]) -> str:
        tree = trees.get()
        try:
            return lives(line, tree)
        finally:
            trees.put(tree)

    bad = 0
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(JOBS) as pool:
        for job in range(JOBS):
            trees.put(copied(Path(folder) / str(job)))
        for line, wrong in zip(lines, pool.map(tried, lines), strict=True):
            bad += bool(wrong)
            print(f"{wrong or 'found':20} {line['file']}: {line['new']}", flush=True)
    print(f"{len(lines)} lines, {bad} not found")
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
