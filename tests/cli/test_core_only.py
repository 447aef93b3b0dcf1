"""Without its extras kmpc says at once which one is missing, in one line, and writes nothing."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

EXTRAS = ("matplotlib", "PIL", "pymavlink", "mujoco", "casadi", "shtab", "serial", "dask")
BLOCKER = f"""
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {EXTRAS!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Blocker())
from firmware_bridge.cli.main import main
sys.exit(main())
"""


def kmpc(folder: Path, line: str) -> subprocess.CompletedProcess[str]:
    """Run a command line where no extra is installed."""
    return subprocess.run(
        [sys.executable, "-c", BLOCKER, *line.split()],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )


@pytest.mark.parametrize(
    ("line", "extra"),
    [
        ("demo", "plot"),
        ("demo --robot rover", "plot"),
        ("demo --robot simulated", "plot"),
        ("demo --log run.csv", "plot"),
        ("report run.npz", "plot"),
        ("simulate mehrez --report run.html", "plot"),
        ("bench --picture bench.png", "plot"),
        ("study table1", "peers"),
        ("study maps", "peers"),
        ("completion bash", "completion"),
        ("emulate mavlink --link pty:link", "bridge"),
        ("emulate mavlink --link pty:link --physics mujoco", "bridge"),
        ("check --driver mavlink --link pty:link", "bridge"),
        ("run --driver mavlink --link pty:link --scenario mehrez", "bridge"),
        ("record --driver mavlink --link pty:link --by-hand --output a", "bridge"),
        ("replay drive.tlog", "bridge"),
        ("latency --drivers mavlink", "bridge"),
        ("experiments a", "twin"),
    ],
)
def test_a_missing_extra_is_told_before_anything_is_done(
    line: str, extra: str, tmp_path: Path
) -> None:
    done = kmpc(tmp_path, line)
    told = done.stderr.splitlines() or done.stdout.splitlines()
    assert done.returncode == 2 and len(told) == 1, done.stderr
    assert told[0].startswith("kmpc: ") and told[0].endswith(f"pip install 'kmpc-lite[{extra}]'")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("simulate --goal 0.5 0 0", 0),
        ("init roboclaw", 0),
        ("estop --status --socket none.sock", 1),
        ("check --driver roboclaw --link pty:none --timeout 0.2", 2),
    ],
)
def test_what_needs_no_extra_works_without(line: str, status: int, tmp_path: Path) -> None:
    done = kmpc(tmp_path, line)
    assert done.returncode == status and "Traceback" not in done.stderr, done.stderr
