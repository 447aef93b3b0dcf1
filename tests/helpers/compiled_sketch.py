"""The sketch for wheel boards, compiled for this machine as strictly as its compiler can."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

SKETCH = Path(__file__).parents[2] / "examples" / "kmpc_wheels"
STRICT = "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined"


def compiled(program: Path, compiler: str, *arguments: str) -> Path:
    """Compile a harness of the sketch; skip the test if there is no compiler."""
    found = shutil.which(compiler)
    if found is None:
        pytest.skip(f"no {compiler}")
    command = [found, *STRICT, f"-I{SKETCH}", *arguments, "-o", str(program)]
    subprocess.run(command, check=True)
    return program
