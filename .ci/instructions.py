"""Count the instructions of an exported controller's step on x86-64 and aarch64, under qemu-user.

python .ci/instructions.py; it takes some minutes. Steps are those of the exported test vectors.
"""

from __future__ import annotations

import re
import subprocess
import tempfile
from pathlib import Path

from firmware import missing, run

import kmpc_lite as kl

TARGETS = {"x86-64": ("cc", "qemu-x86_64"), "aarch64": ("aarch64-linux-gnu-gcc", "qemu-aarch64")}
"""Compiler and emulator."""
ENTERED = re.compile(rb"^Trace \d+: 0x[0-9a-f]+ \[[0-9a-f]+/([0-9a-f]+)/")
INSTRUCTION = re.compile(rb"^0x([0-9a-f]+):")


def count(emulator: str, program: Path) -> int:
    """Instructions of a whole run: the lengths of all blocks that the emulator enters."""
    log = [emulator, "-d", "in_asm,exec,nochain", "-D", "/dev/stderr", program]
    running = subprocess.Popen(log, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    lengths: dict[int, int] = {}
    total, first = 0, None
    for line in running.stderr or ():
        if entered := ENTERED.match(line):
            total += lengths[int(entered[1], 16)]
        elif line.startswith(b"IN:"):
            first = None
        elif found := INSTRUCTION.match(line):
            at = int(found[1], 16)
            first = at if first is None else first
            lengths[first] = 1 if at == first else lengths[first] + 1
    if running.wait():
        raise SystemExit(f"{program}: failed under {emulator}")
    return total


def main() -> None:
    """Print a row a target."""
    with tempfile.TemporaryDirectory() as name:
        folder = kl.export(kl.nominal_unicycle(0.1), kl.NavigationProblem(), Path(name) / "robot")
        steps = int(re.search(r"VECTORS = (\d+)", (folder / "vectors.h").read_text())[1])
        for target, (compiler, emulator) in TARGETS.items():
            if lacking := missing(f"{compiler} {emulator} make"):
                print(f"{target:10} skipped: {lacking} missing")
                continue
            make = ("make", "-s", "-C", folder, f"CC={compiler}", "CFLAGS=-O2 -static")
            run(*make, "clean")
            run(*make, "vectors")
            told = count(emulator, folder / "vectors") / steps
            print(f"{target:10} {told / 1e6:.2f} million instructions a step, over {steps} steps")


if __name__ == "__main__":
    main()
