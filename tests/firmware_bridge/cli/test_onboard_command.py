"""`kmpc onboard`: what a board runs, and whether that is what was exported."""

import json

import pytest
from boards import GEOMETRY

import kmpc_lite as kl
from kmpc_lab.emulator.onboard import OnboardEmulator
from kmpc_lite.cli.main import main

LINK = "pty:board"


@pytest.fixture
def board(desk):
    board = OnboardEmulator.from_options({"geometry": GEOMETRY})
    board.start(LINK)
    yield board
    board.close()


def exported(folder, **problem):
    return str(kl.export(kl.nominal_unicycle(0.1), kl.NavigationProblem(**problem), folder))


def test_a_board_that_runs_the_export_is_distinguished_from_one_that_does_not(
    board, tmp_path, capsys
):
    ask = ["onboard", LINK, "--timeout", "30"]
    assert main([*ask, "--export", exported(tmp_path / "same")]) == 0
    told = capsys.readouterr().out
    assert "20 stages of 0.1 s, radius 0.15 m" in told and "same   as" in told
    assert main([*ask, "--export", exported(tmp_path / "other", horizon=8), "--json"]) == 1
    told = json.loads(capsys.readouterr().out)
    assert told["board"]["horizon"] == 20
    assert told["differences"] == ["horizon: expected 8, the board has 20: flash it again"]
    assert main(ask) == 0 and "20 stages" in capsys.readouterr().out


def test_a_silent_line_and_a_folder_without_an_export_are_reported(desk, tmp_path, capsys):
    assert main(["onboard", "tcp:127.0.0.1:1", "--timeout", "0.3"]) == 2
    assert "nothing listens there" in capsys.readouterr().err
    assert main(["onboard", LINK, "--export", str(tmp_path)]) == 2
    assert "no exported controller" in capsys.readouterr().err
