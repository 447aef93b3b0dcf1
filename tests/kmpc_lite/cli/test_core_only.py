"""Without its extras kmpc says at once which one is missing, in one line, and writes nothing."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

EXTRAS = ("matplotlib", "PIL", "pymavlink", "mujoco", "casadi", "shtab", "serial", "dask")
EXTRAS += ("rosbags", "pyulog")
BLOCKER = f"""
import sys
class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {EXTRAS!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Blocker())
import contextlib, io, json
from kmpc_lite.cli.main import main
told = {{}}
for line in sys.argv[1:]:
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        status = main(line.split())
    told[line] = [status, out.getvalue()]
json.dump(told, sys.stdout)
"""


def kmpc(folder: Path, *lines: str) -> dict[str, list[Any]]:
    """Status and words of command lines that run, one after the other, if no extra is
    installed.
    """
    done = subprocess.run(
        [sys.executable, "-c", BLOCKER, *lines],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return dict(json.loads(done.stdout))


def test_a_missing_extra_is_reported_before_anything_is_done(tmp_path: Path) -> None:
    missing = {
        "demo": "kmpc-lab[plot]",
        "demo --robot rover": "kmpc-lab[plot]",
        "demo --robot simulated": "kmpc-lab[plot]",
        "demo --log run.csv": "kmpc-lab[plot]",
        "report drive": "kmpc-lab[plot]",
        "simulate mehrez --report run.html": "kmpc-lab[plot]",
        "study table1": "kmpc-lab[peers]",
        "study maps": "kmpc-lab[peers]",
        "study jumps --drives 1 --picture worst.png": "kmpc-lab[plot]",
        "emulate mavlink --link pty:link": "kmpc-lite[bridge]",
        "emulate mavlink --link pty:link --physics mujoco": "kmpc-lite[bridge]",
        "check --driver mavlink --link pty:link": "kmpc-lite[bridge]",
        "run --driver mavlink --link pty:link --scenario mehrez": "kmpc-lite[bridge]",
        "record --driver mavlink --link pty:link --by-hand --output a": "kmpc-lite[bridge]",
        "fit run.mcap -o robot.npz": "kmpc-lite[logs]",
        "fit good.csv run.ulg -o robot.npz": "kmpc-lite[logs]",
        "inspect run.tlog": "kmpc-lite[logs]",
        "inspect run.csv --plot run.png": "kmpc-lab[plot]",
    }
    for line, (status, text) in kmpc(tmp_path, *missing).items():
        assert status == 2 and text.count("\n") == 1, (line, text)
        assert text.startswith("kmpc: ")
        assert text.endswith(f"pip install '{missing[line]}'\n"), text
    assert list(tmp_path.iterdir()) == []
