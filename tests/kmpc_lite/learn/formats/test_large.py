"""A large bag takes no more memory than a small one."""

import subprocess
import sys
from pathlib import Path

import pytest
from big_bag import write_big_bag

FIT = """
import re, sys
from kmpc_lite.cli.main import main
status = main(["fit", sys.argv[1], "-o", sys.argv[2], "--json"])
# its own: getrusage would count what whoever started it had, too
kilobytes = re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1]
print("\\npeak", status, int(kilobytes) // 1024)
"""


@pytest.mark.long
@pytest.mark.parametrize("kind", ["sqlite3", "mcap", "ros1"])
def test_a_gigabyte_is_fitted_in_300_megabytes(tmp_path: Path, kind: str) -> None:
    pytest.importorskip("rosbags")
    made = write_big_bag(tmp_path / ("big.bag" if kind == "ros1" else "big"), kind, 10**9)
    command = [sys.executable, "-c", FIT, str(made), str(tmp_path / "model.npz")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    status, megabytes = map(int, done.stdout.rpartition("peak")[2].split())
    assert status == 0, done.stdout[-400:] + done.stderr[-400:]
    assert megabytes < 300
