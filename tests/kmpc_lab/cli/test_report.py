"""`kmpc report`: a page or a picture of a run that was kept."""

import json
import re
from pathlib import Path

import pytest
from command_folder import NEEDS_PICTURES, files

from kmpc_lite.cli import main as cli


def test_report_of_a_run_and_of_its_model(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(f"report {made}/run -o run.html --model {made}/robot.npz --json".split()) == 0
    assert json.loads(capsys.readouterr().out) == {"written": ["run.html"]}
    page = (here / "run.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html>")
    # self-contained: nothing is fetched
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", page)


@NEEDS_PICTURES
def test_report_as_a_picture(made: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["report", str(made / "run"), "--picture", "run.png"]) == 0
    assert capsys.readouterr().out.split() == ["wrote", "run.png"] and files(here) == ["run.png"]
    assert Path("run.png").read_bytes().startswith(b"\x89PNG")


@NEEDS_PICTURES
@pytest.mark.parametrize(
    "line",
    ["report {made}/run -o no/folder/run.html", "report {made}/run --picture no/folder/run.png"],
)
def test_a_report_that_cannot_be_written_is_reported_in_one_line(
    line: str, made: Path, here: Path, capsys: pytest.CaptureFixture[str], blank: None
) -> None:
    assert cli.main([word.format(made=made) for word in line.split()]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert files(here) == []
