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


NAMED = {
    ("wheels_rpm.csv", "--track 0.35"): "the wheels run 0.00635 m",
    ("wheels_rad_s.csv", "--track 0.35"): "the wheels run 0.06",
    ("wheels_mm_s_4hz.csv", "--track 0.35"): "--units left=mm/s right=mm/s",
    ("header_rpm.csv", "--track 0.35"): "left is in rpm, the turns of a wheel: --wheel-radius",
    ("header_rads.csv", "--track 0.35"): "left is in rad/s, the turns of a wheel: --wheel-radius",
    ("header_says_cm.csv", "--track 0.35"): "x was read in cm, y was read in cm; --units x=m y=m",
    ("vicon.csv", ""): "an export of Vicon Nexus",
    ("motive.csv", ""): "an export of OptiTrack Motive",
    ("remarks.csv", ""): "line 8, column t: time must grow",
    ("lfs_pointer.csv", ""): "a pointer of Git LFS",
    ("lfs_pointer.bin", ""): "a pointer of Git LFS",
}


@pytest.mark.parametrize(("case", "told"), NAMED.items(), ids=[name for name, _ in NAMED])
def test_what_is_wrong_is_named(case, told, capsys, tmp_path) -> None:
    said = fitted(case[0], capsys, tmp_path, *case[1].split())
    assert said.startswith("status 2") and told in said, said


LEARNED = {
    "header_degps.csv": "",
    "header_inches.csv": "--track 0.35",
    "header_rpm.csv": "--track 0.35 --wheel-radius 0.0625",
    "header_rads.csv": "--track 0.35 --wheel-radius 0.0625",
    "wheels_rpm.csv": "--track 0.35 --wheel-radius 0.0625 --units left=rpm right=rpm",
    "wheels_rad_s.csv": "--track 0.35 --wheel-radius 0.0625 --units left=rad/s right=rad/s",
    "wheels_mm_s_4hz.csv": "--track 0.35 --units left=mm/s right=mm/s",
    "header_says_cm.csv": "--track 0.35 --units x=m y=m",
    "clock_steps_back.tlog": "",
}


@pytest.mark.parametrize(("name", "words"), LEARNED.items(), ids=LEARNED)
def test_what_is_understood_is_learned_as_it_drove(name, words, capsys, tmp_path) -> None:
    if name.endswith(".tlog"):
        pytest.importorskip("pymavlink")
    said = fitted(name, capsys, tmp_path, *words.split())
    assert said.startswith("status 0") and "suspect" not in said, said
    speed = float(said.split("drive up to ")[1].split(" m/s")[0])
    assert 0.3 < speed < 1.0
