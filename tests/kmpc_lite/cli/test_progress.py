"""Progress is drawn on a terminal only, and no time left is shown before it can be known."""

import sys
import threading

import pytest

from kmpc_lite.cli import progress
from kmpc_lite.cli.progress import ProgressBar, remaining, watching


def terminal(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Make standard error a terminal, and give a clock that is turned by hand [s]."""
    now = [0.0]
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def last(capsys: pytest.CaptureFixture[str]) -> str:
    return capsys.readouterr().err.rpartition("\x1b[2K")[2]


def test_the_time_left_is_reported_once_something_is_done(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = terminal(monkeypatch)
    bar = ProgressBar("work")
    bar(0, 160)
    assert last(capsys) == f"work [{'.' * 30}] 0/160  time left not known yet"
    now[0] = 10.0
    bar(40, 160)
    assert last(capsys).endswith("40/160  about 30 s left")
    now[0] = 40.0
    bar(160, 160)
    assert last(capsys) == f"work [{'#' * 30}] 160/160\n"


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (None, "time left not known yet"),
        (0.1, "about 1 s left"),
        (59.0, "about 59 s left"),
        (150.0, "about 2 min left"),
        (7500.0, "about 2 h 05 min left"),
    ],
)
def test_estimates_are_no_more_exact_than_they_can_be(seconds: float | None, words: str) -> None:
    assert remaining(seconds) == words


def test_a_watched_line_is_drawn_and_wiped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setattr(progress, "PERIOD", 0.001)
    drawn = threading.Event()

    def line() -> str:
        drawn.set()
        return "3 of 50 s"

    with watching(line):
        assert drawn.wait(20.0)
    err = capsys.readouterr().err
    assert "3 of 50 s" in err and err.endswith("\r\x1b[2K")
    with watching(line, quiet=True):
        pass
    assert capsys.readouterr().err == ""


def test_progress_is_drawn_on_a_terminal_only(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for terminal, quiet, drawn in ((False, False, False), (True, False, True), (True, True, False)):
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal)
        bar = ProgressBar("work", quiet=quiet)
        for done in range(4):
            bar(done, 3)
        out, err = capsys.readouterr()
        assert out == ""
        assert ("work [##############################] 3/3" in err and err.endswith("\n")) == drawn
        assert bool(err) == drawn
