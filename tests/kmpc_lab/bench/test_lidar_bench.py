"""`kmpc bench --lidar`: what is timed, and how it is told; never how long it takes."""

from __future__ import annotations

import json

from kmpc_lab.bench import lidar
from kmpc_lite.cli.main import main


def test_both_kinds_of_steps_are_timed_phase_by_phase(monkeypatch, capsys) -> None:
    monkeypatch.setattr(lidar, "STEPS", 12)
    assert main(["bench", "--lidar", "--drives", "2", "--tuning", "--json"]) == 0
    circles, scan = json.loads(capsys.readouterr().out)
    assert (circles["name"], scan["name"]) == ("4 circles", "scan, 360 beams")
    # the first step of a drive is left out
    assert circles["steps"] == scan["steps"] == 2 * 11
    for row in (circles, scan):
        ms, phases = row["ms"], row["phases_ms"]
        assert 0.0 < ms["p50"] <= ms["p99"] <= ms["p99.9"] <= ms["max"]
        assert set(phases) == set(lidar.PHASES) and phases["total"]["p50"] == ms["p50"]
    text = lidar.format_lidar_steps([circles, scan])
    assert "x first" in text and text.count("estimate") == 2


def test_a_drive_is_recorded_until_its_goal_is_held() -> None:
    controller = lidar.Controller(lidar.nominal_unicycle(0.1), lidar.STANDARD.problem(lidar.SIDE))
    recorded = lidar._record(controller, lidar._past_circles(7000), 7000)
    assert 10 < len(recorded) < lidar.STEPS
    (pose, goal, _), last = recorded[0], recorded[-1][0]
    assert abs(pose[:2] - goal[:2]).max() > 0.3 > abs(last[:2] - goal[:2]).max()
