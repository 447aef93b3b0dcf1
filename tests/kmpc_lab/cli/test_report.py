"""`kmpc report`: a page or pictures of a run that was kept."""

import json
import re
from pathlib import Path

import pytest
from command_folder import NEEDS_PICTURES, files

from kmpc_lite.cli import main as cli


def test_report_of_a_run_and_of_its_model(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        cli.main(f"report {made}/run.npz -o run.html --model {made}/robot.npz --json".split()) == 0
    )
    assert json.loads(capsys.readouterr().out) == {"written": ["run.html"]}
    page = (here / "run.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html>")
    # self-contained: nothing is fetched
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", page)


@NEEDS_PICTURES
def test_report_as_pictures(made: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["report", str(made / "run.npz"), "--pictures", "figures"]) == 0
    told = [line.split()[-1] for line in capsys.readouterr().out.splitlines()]
    assert told and sorted(told) == sorted(
        str(Path("figures") / p.name) for p in (here / "figures").iterdir()
    )
    for name in told:
        assert Path(name).read_bytes().startswith(b"\x89PNG")


@NEEDS_PICTURES
@pytest.mark.parametrize(
    "line",
    [
        "report {made}/run.npz -o no/folder/run.html",
        "report {made}/run.npz --pictures {made}/drive.csv",
    ],
)
def test_a_report_that_cannot_be_written_is_reported_in_one_line(
    line: str, made: Path, here: Path, capsys: pytest.CaptureFixture[str], blank: None
) -> None:
    assert cli.main([word.format(made=made) for word in line.split()]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert files(here) == []
