"""Boards side by side: what `kmpc bench --json` wrote is read back, and nothing else is."""

from __future__ import annotations

import importlib
import json
from pathlib import Path

import pytest
from pages import DOCS

from kmpc_lab.bench.boards import format_boards, read_board, this_machine
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


def test_the_page_shows_boards_or_says_that_there_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(DOCS / "_site"))
    hooks = importlib.import_module("hooks")
    monkeypatch.setattr(hooks, "ROOT", tmp_path)
    (folder := tmp_path / "docs" / "boards").mkdir(parents=True)
    page = "# P\n\n<!-- boards: boards -->\n"
    assert "No board has been measured" in hooks.on_page_markdown(page)
    board = read_board(written(folder, "Pi 5", {"ours": 0.75}))
    assert format_boards([board]) in hooks.on_page_markdown(page)
