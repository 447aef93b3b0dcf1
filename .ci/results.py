"""Run the commands of `docs/results` again and keep what they print: `make results`.

Each command stands above its table in a page. ``make results ARGS="table1 jumps"`` runs those that
hold one of these words. What needs a file or a vehicle that is not here is left out, and says so.
Printed is what the pages are written from: ``out/results/PAGE.txt``.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
BLOCK = re.compile(r"```sh\n(.*?)```", re.DOTALL)
NEEDS = re.compile(r"\S+\.(?:csv|npz|mcap)$|^tcp:\S+")
"""Words that name what a command reads."""
WRITES = ("-o", "--output", "--to", "--picture")


def missing(words: list[str], folder: Path) -> str:
    """Name what a command reads and is not here; nothing if all is."""
    read = [b for a, b in zip(["", *words], words, strict=False) if a not in WRITES]
    return next((w for w in read if NEEDS.match(w) and not (folder / w).exists()), "")


def main(wanted: list[str]) -> int:
    """Run the commands, page by page; status 1 if one fails."""
    folder, bad = ROOT / "out" / "results", 0
    folder.mkdir(parents=True, exist_ok=True)
    paths = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    modules = os.pathsep.join(str(ROOT / name) for name in ("", "lab", "tests"))
    environment = {**os.environ, **threads, "PATH": paths, "PYTHONPATH": modules}
    for page in sorted((ROOT / "docs" / "results").glob("*.md")):
        lines = [line for block in BLOCK.findall(page.read_text()) for line in block.splitlines()]
        chosen = [one for one in lines if not wanted or any(word in one for word in wanted)]
        kept = []
        for line in chosen:
            words = shlex.split(line.partition("#")[0])
            print(f"\n$ {line}", flush=True)
            if lacks := missing(words, folder):
                print(f"left out: {lacks} is not in {folder}")
                continue
            command = [word for word in words if not word.startswith("PYTHONPATH=")]
            done = subprocess.run(command, cwd=folder, env=environment, stdout=subprocess.PIPE)
            told = done.stdout.decode()
            print(told, end="", flush=True)
            kept.append(f"$ {line}\n{told}\n")
            bad += done.returncode not in (0, 1)  # a study ends with 1 where something was touched
        if kept:
            (folder / f"{page.stem}.txt").write_text("\n".join(kept))
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
