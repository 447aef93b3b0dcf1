"""Public users' troubles, read in place: what they get is right, or is refused by its name."""

from pathlib import Path

import pytest

from kmpc_lite.cli.main import main

CASES = Path(__file__).parents[4] / "shared" / "cases" / "logs"
pytestmark = pytest.mark.skipif(not CASES.is_dir(), reason="needs ../shared/cases")


def fitted(name: str, capsys: pytest.CaptureFixture[str], tmp_path: Path, *words: str) -> str:
    """What `kmpc fit` says of a case, with its status."""
    status = main(["fit", str(CASES / name), "-v", "-o", str(tmp_path / "m.npz"), *words])
    out, err = capsys.readouterr()
    assert "Traceback" not in out + err
    return f"status {status}: {out}{err}"


def test_a_robot_that_is_late_is_not_told_to_flip_a_sign(capsys, tmp_path) -> None:
    told = fitted("weaving_late_0.5s.csv", capsys, tmp_path)
    assert told.startswith("status 0") and "--units" not in told
    assert "0.50 s dead time" in told
    told = fitted("slalom_late_0.5s.csv", capsys, tmp_path)
    assert "--units" not in told and "ambiguous: the commands are periodic" in told
