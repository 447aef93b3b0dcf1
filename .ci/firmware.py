"""Exported controllers on this machine, on aarch64 and on Cortex-M: vectors, memory, instructions.

python .ci/firmware.py; a target whose tools are missing is skipped with a word.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import kmpc_lite as kl
from kmpc_lite.model.dictionary import ResponseDictionary
from kmpc_lite.model.noise_model import NoiseModel

BARE_METAL = Path(__file__).parent.parent / "examples" / "firmware"
STRICT = "WARN=-Wall -Wextra -Werror -pedantic"
SANITIZED = "CFLAGS=-O1 -g -fsanitize=address,undefined -fno-sanitize-recover=all"
ON_PC = {
    "x86-64, gcc": ("cc", "CC=cc", STRICT),
    "x86-64, clang": ("clang", "CC=clang", STRICT),
    "x86-64, sanitizers": ("cc", "CC=cc", SANITIZED),
    "aarch64, qemu-user": (
        "aarch64-linux-gnu-gcc qemu-aarch64",
        "CC=aarch64-linux-gnu-gcc",
        "CFLAGS=-O2 -static",
    ),
}
"""Tools that a target needs, the compiler, and what else make is given."""
ARM = "arm-none-eabi-gcc qemu-system-arm make"
BOARDS = {
    "Teensy 4.1": ("m7", 600.0, 1.0),
    "STM32H743": ("m7", 480.0, 1.1),
    "STM32F4": ("m4", 168.0, 1.5),
    "ESP32-S3": ("m4", 240.0, 1.8),
    "Pi Zero 2": ("m7", 1000.0, 1.2),
}
"""Whose instructions are counted for it, its clock [MHz], and cycles an instruction that are
assumed: caches, dual issue and waits for flash are not emulated."""


class Limits(NamedTuple):
    """What a float controller of a robot that obeys at once may take."""

    board: str
    ms: float
    """A step past four circles, in the mean [ms]."""
    ram: float
    flash: float
    """[KB]"""
    horizon: int


LIMITS = {
    "m7": Limits("Teensy 4.1", 5.0, 256.0, 256.0, 20),
    "m4": Limits("STM32F4", 50.0, 128.0, 256.0, 10),
}


def learned() -> kl.KoopmanModel:
    """Make a model that lags and knows its noise, as `fit` makes them."""
    noise = np.zeros((3, 3, 3))
    noise[0] = 1e-7 * np.eye(3)
    noise[1], noise[2] = np.diag([1e-4, 5e-5, 1e-5]), np.diag([1e-5, 1e-5, 1e-4])
    model = replace(kl.nominal_unicycle(0.1), noise_model=NoiseModel(noise))
    late = ResponseDictionary(model.dictionary, speed=(0.3, 0.5, 0.2), turn=(0.2, 0.8))
    return replace(model, dictionary=late)


def exported(folder: Path, model: kl.KoopmanModel, horizon: int, float32: bool) -> Path:
    """Write a controller of the paper's robot."""
    return kl.export(model, kl.NavigationProblem(horizon=horizon), folder, float32=float32)


def missing(tools: str) -> str:
    """Which tools are not there."""
    return ", ".join(tool for tool in tools.split() if shutil.which(tool) is None)


def run(*command: str | Path) -> str:
    """Run a command; what it wrote, which the error shows if it fails."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}:\n{done.stdout}{done.stderr}")
    return done.stdout


def on_pc(source: Path, name: str) -> None:
    """Build and run the vectors for a target of this machine."""
    tools, *options = ON_PC[name]
    if lacking := missing(tools):
        print(f"{name:36} skipped: {lacking} missing")
        return
    with tempfile.TemporaryDirectory() as folder:
        built = Path(shutil.copytree(source, Path(folder) / "robot"))
        run("make", "-s", "-j2", "-C", built, *options, "vectors")
        emulator = tools.split()[1:]
        print(f"{name:36} {run(*emulator, built / 'vectors').strip()}")


def checked(source: Path) -> None:
    """Have cppcheck read all C that is ours."""
    if lacking := missing("cppcheck"):
        print(f"{'cppcheck':36} skipped: {lacking} missing")
        return
    files = sorted([*(source / "src").glob("*.c"), *BARE_METAL.glob("*.c")])
    kinds = "--enable=warning,performance,portability"
    ask = ["cppcheck", "--quiet", "--std=c99", kinds, "--error-exitcode=1"]
    around = f"--suppress=*:{source / 'src' / 'osqp'}/*"
    run(*ask, around, "-I", source / "src", "-I", BARE_METAL, *files)
    print(f"{'cppcheck':36} silent about {len(files)} files")


def on_board(source: Path, cpu: str, work: Path, what: str) -> dict[str, tuple[float, ...]]:
    """Build the robot and the measurement for a board of QEMU: what they take."""
    build = work / f"{source.name}-{cpu}"
    options = ["make", "-s", "-j2", "-C", str(BARE_METAL), f"KMPC={source}", f"CPU={cpu}"]
    run(*options, f"BUILD={build}", "all")
    told = run(*options, f"BUILD={build}", "measure").splitlines()
    print(f"{what:36} {told[0]}")
    found = {name: tuple(map(float, rest)) for name, *rest in map(str.split, told[1:])}
    sizes = run("arm-none-eabi-size", build / "robot.elf").splitlines()[1].split()
    text, data, bss = (int(word) / 1024 for word in sizes[:3])
    stack = found["stack"][0] / 1024
    found["memory"] = text + data, data + bss + stack, stack
    objects = [str(path) for path in build.rglob("*.o") if path.name not in NOT_OURS]
    doubles = {word for word in run("arm-none-eabi-nm", "-u", *objects).split() if is_double(word)}
    if cpu == "m4" and doubles:
        raise SystemExit(f"{source.name}: double in a float controller: {sorted(doubles)}")
    return found


NOT_OURS = frozenset(("measure.o", "vectors.o"))
"""Objects that print, in double as C does."""


def is_double(symbol: str) -> bool:
    """Whether a name is of the compiler's own arithmetic for double."""
    return symbol.startswith(("__aeabi_d", "__aeabi_f2d"))


def tell(cpu: str, found: dict[str, tuple[float, ...]]) -> bool:
    """Print what a step takes; whether it is within its limits."""
    flash, ram, stack = found["memory"]
    (mean, most), (_, single) = found["drive"], found["one_pass"]
    print(
        f"  flash {flash:.0f} KB, RAM {ram:.0f} KB with {stack:.0f} KB of stack; instructions of a "
        f"step past four circles: {mean / 1e6:.2f} M in the mean, {single / 1e6:.2f} M at most in "
        f"one pass, {most / 1e6:.2f} M in all its passes"
    )
    for board, (counted, clock, cycles) in BOARDS.items():
        if counted == cpu:
            ms = [count * cycles / clock / 1e3 for count in (mean, single, most)]
            print(
                f"  estimate {board:12} {clock:4.0f} MHz, {cycles:g} cycles an instruction: "
                f"{ms[0]:.1f} ms, at most {ms[1]:.1f} and {ms[2]:.1f} ms"
            )
    limit = LIMITS[cpu]
    _, clock, cycles = BOARDS[limit.board]
    slow = mean * cycles / clock / 1e3 > limit.ms
    return not (slow or ram > limit.ram or flash > limit.flash)


def main() -> int:
    """Run all targets; 1 if a limit is exceeded."""
    good = True
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        double = exported(work / "double", learned(), 10, False)
        checked(double)
        for name in ON_PC:
            on_pc(double, name)
        if lacking := missing(ARM):
            print(f"{'Cortex-M':36} skipped: {lacking} missing")
            return 0
        for cpu, limit in LIMITS.items():
            for kind, model in (("nominal", kl.nominal_unicycle(0.1)), ("learned", learned())):
                # plans of a robot that lags are flat: over 20 stages float finds other ones
                float32 = kind == "nominal" or cpu == "m4"
                source = exported(work / f"{kind}-{cpu}", model, limit.horizon, float32)
                number = "float" if float32 else "double"
                what = f"Cortex-{cpu.upper()}, {kind}, N = {limit.horizon}, {number}"
                within = tell(cpu, on_board(source, cpu, work, what))
                good = good and (within or kind == "learned")
    if not good:
        print("a limit is exceeded: see LIMITS in .ci/firmware.py")
    return 0 if good else 1


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    sys.exit(main())
