"""kmpc demo, shortened.

The phases follow each other through files, and a signal ends them.
"""

import json

import pytest

from kmpc_lab import Run
from kmpc_lite.cli.main import main


@pytest.mark.long
def test_the_whole_demo_reaches_its_goal(tmp_path, capsys):
    assert main(["demo", "--output", str(tmp_path / "out"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (
        report["outcome"] == "reached" and Run.load(tmp_path / "out" / "run.npz").clearance > 0.03
    )
