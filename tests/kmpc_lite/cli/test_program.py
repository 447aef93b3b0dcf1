"""kmpc as a program: its status, its streams, and Ctrl-C."""

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from command_folder import SHORT


@pytest.mark.parametrize(
    ("command", "buffered"),
    [
        (["simulate", "--scenario", "short.toml"], True),
        (["simulate", "--scenario", "short.toml"], False),
        (["fit", "--help"], True),
    ],
)
def test_a_reader_that_leaves_is_no_error(made: Path, command: list[str], buffered: bool) -> None:
    with open("/dev/null") as nothing:
        reader = subprocess.Popen(["true"], stdin=subprocess.PIPE)
        reader.wait()
        assert reader.stdin is not None
        done = subprocess.run(
            [sys.executable, "-m", "kmpc_lite.cli.main", *command],
            cwd=made,
            env={**os.environ, "PYTHONUNBUFFERED": "" if buffered else "1"},
            stdin=nothing,
            stdout=reader.stdin,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
            check=False,
        )
        reader.stdin.close()
    assert done.stderr == ""
    assert done.returncode == 141


def test_control_c_ends_it_at_once_without_a_traceback(tmp_path: Path) -> None:
    # it can never arrive: the goal is behind a wall of obstacles
    wall = ", ".join(f"[1.0, {y:.2f}, 0.15]" for y in np.arange(-2.0, 2.01, 0.2))
    endless = tmp_path / "endless.toml"
    endless.write_text(
        SHORT.replace("[[0.5, 0.6, 0.15]]", f"[{wall}]")
        .replace("0.7, 0.0, 0.0", "1.5, 0.0, 0.0")
        .replace("4.0", "1e5")
    )
    process = subprocess.Popen(
        [
            sys.executable,
            *f"-m kmpc_lite.cli.main simulate --scenario {endless} --record {tmp_path}/run".split(),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # where the tests run in the background it is ignored, and children inherit that
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    try:
        # at work once the solver's library is loaded
        maps = Path(f"/proc/{process.pid}/maps")
        while process.poll() is None and "osqp" not in maps.read_text():
            time.sleep(0.05)
        time.sleep(0.5)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    # the interpreter ends by the signal itself where that came while C code ran some Python of its
    # own, as a busy machine that still imports may do: a shell shows 130 for both
    assert process.returncode in (130, -signal.SIGINT) and err == "kmpc: stopped\n"
    assert out in ("", "Solver interrupted\n")  # OSQP's own words
    assert [p.name for p in tmp_path.iterdir()] == ["endless.toml"]
