"""Boards side by side: what `kmpc bench --json` wrote is read back, and nothing else is."""

import json
from pathlib import Path

import pytest

from kmpc_lab.bench.steps import read_board, this_machine
from kmpc_lite.cli import main as cli
from kmpc_lite.errors import DataError


def written(folder: Path, name: str, steps: dict[str, float]) -> Path:
    rows = [{"name": label, "ms": {"p50": ms, "p99": 2 * ms}} for label, ms in steps.items()]
    told = {"machine": {**this_machine(), "name": name}, "tables": {"one": rows}}
    file = folder / f"{name}.json"
    file.write_text(json.dumps(told))
    return file


def test_boards_stand_side_by_side(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pi = written(tmp_path, "Pi 5", {"ours": 0.75, "IPOPT": 8.0})
    pc = written(tmp_path, "PC", {"ours": 0.3})
    assert cli.main(["bench", "--beside", str(pi), str(pc)]) == 0
    first, _, machines, *rows = capsys.readouterr().out.splitlines()
    assert first == "| step [ms], p50 / p99 | Pi 5 | PC |"
    assert machines.count(f"{this_machine()['cores']} cores") == 2
    assert rows == ["| ours | 0.75 / 1.5 | 0.3 / 0.6 |", "| IPOPT | 8 / 16 | - |"]


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"machine": {}, "tables": {}}'])
def test_other_files_are_refused(text: str, tmp_path: Path) -> None:
    file = tmp_path / "other.json"
    file.write_text(text)
    with pytest.raises(DataError, match="other.json: expected what kmpc bench --json writes"):
        read_board(file)
