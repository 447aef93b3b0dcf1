"""`kmpc bench --lidar` and `--against`: what is timed and printed; never how long it takes."""

import json
import shutil
import subprocess
from pathlib import Path

from kmpc_lab.bench import against, cold, lidar
from kmpc_lab.cli.bench import jobs
from kmpc_lite.cli.main import main

NAMES = ["4 circles", "scan, 360 beams", "scan, 720 beams", "scan, 1440 beams"]


def test_steps_of_all_kinds_are_timed_phase_by_phase(monkeypatch, capsys) -> None:
    monkeypatch.setattr(lidar, "STEPS", 12)
    assert main(["bench", "--lidar", "--drives", "2", "--tuning", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in rows] == NAMES
    circles, scan = rows[:2]
    # the first step of a drive is left out
    assert circles["steps"] == scan["steps"] == 2 * 11
    for row in (circles, scan):
        ms, phases = row["ms"], row["phases_ms"]
        assert 0.0 < ms["p50"] <= ms["p99"] <= ms["p99.9"] <= ms["max"]
        assert set(phases) == set(lidar.PHASES) and phases["total"]["p50"] == ms["p50"]
    text = lidar.format_lidar_steps([circles, scan])
    assert "x first" in text and text.count("estimate") == 2


def test_cold_steps_are_taken_in_turns(monkeypatch, capsys) -> None:
    """All contenders from the same states; drives past circles and by lidar in both languages."""
    monkeypatch.setattr(lidar, "STEPS", 4)
    monkeypatch.setattr(cold, "PAUSE", 0.0)
    quick = [c for c in cold.COLD_CONTENDERS if c.label.startswith("ours")]
    monkeypatch.setattr(cold, "COLD_CONTENDERS", quick)
    assert main(["bench", "--cold", "--drives", "1", "--tuning", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    first, second = told["tables"].values()
    stepped = {row["name"] for row in first}
    assert stepped | set(told["left_out"]) == {c.label for c in quick}
    assert [row["name"] for row in second] == [
        f"{name}, {how}" for name in NAMES for how in cold.KERNELS
    ]
    # the first step of a drive is left out
    assert {row["steps"] for row in first} == {jobs.STEPS - 1}
    assert {row["steps"] for row in second} == {lidar.STEPS - 1}
    assert "x first" in cold.format_cold(told)


def test_another_commit_is_stepped_through_the_same_inputs(monkeypatch, capsys, tmp_path) -> None:
    root = Path(lidar.__file__).parents[3]
    exported = tmp_path / "checkout"
    shutil.copytree(root / "kmpc_lite", exported / "kmpc_lite")
    git = ["git", "-C", str(exported), "-c", "user.name=a", "-c", "user.email=a@b.c"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "all"]):
        subprocess.run([*git, *words], check=True)
    monkeypatch.setattr(lidar, "STEPS", 6)
    monkeypatch.setattr(against.kmpc_lite, "__file__", str(exported / "kmpc_lite/__init__.py"))
    asked = ["bench", "--against", "HEAD", "--drives", "1", "--tuning"]
    assert main([*asked, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["name"] for row in rows] == NAMES
    for row in rows:
        assert row["steps"] == 5
        assert row["ratio"]["p50"] == row["ms"]["p50"] / row["other_ms"]["p50"]
    assert "this / other" in against.format_against(rows, "HEAD")

    assert main(["bench", "--against", "nosuchcommit", "--drives", "1"]) == 2
    assert "--against nosuchcommit" in capsys.readouterr().err
