"""The board of examples/own_board, as it stands there: found by its entry point, driven."""

import json
import os
import shutil
import subprocess
import sys

from pages import ROOT, read

BOARD = ROOT / "examples" / "own_board"


def test_a_board_of_ones_own_is_one_class_and_one_entry_point(tmp_path):
    assert len(read(BOARD / "wheelie.py").splitlines()) <= 80
    shutil.copytree(BOARD, tmp_path, dirs_exist_ok=True)
    entry = read(BOARD / "pyproject.toml")
    (installed := tmp_path / "wheelie-1.dist-info").mkdir()
    (installed / "METADATA").write_text("Metadata-Version: 2.1\nName: wheelie\nVersion: 1\n")
    name, _, where = entry.splitlines()[-1].partition(" = ")
    (installed / "entry_points.txt").write_text(f"[kmpc.boards]\n{name} = {where.strip(chr(34))}\n")
    here = {"cwd": tmp_path, "env": {**os.environ, "PYTHONPATH": str(tmp_path)}}

    def kmpc(*words):
        program = [sys.executable, "-m", "kmpc_lite.cli.main", *words, "--json"]
        done = subprocess.run(program, capture_output=True, text=True, timeout=100, **here)
        return done.returncode, json.loads(done.stdout)

    status, told = kmpc("check", "robot.toml", "--set", "link.timeout=0.3")
    assert status != 0 and "no such port" in json.dumps(told)
    with subprocess.Popen([sys.executable, "emulated_wheelie.py"], **here) as board:
        try:
            status, report = kmpc("run", "robot.toml", "--goal", "0.4", "0", "0", "--seconds", "60")
            assert status == 0 and report["arrived"], report
        finally:
            board.kill()
    (tmp_path / "wheelie.py").write_text("import nothing_of_the_kind\n")
    status, told = kmpc("check", "robot.toml")
    assert status == 2 and "cannot import wheelie:WheelieDriver" in told["error"]
