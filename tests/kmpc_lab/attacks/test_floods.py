"""What floods are made of, and how their cost is reported; the floods themselves are long tests."""

import json
import math
from pathlib import Path

import pytest

from kmpc_lab.attacks.attacker import KINDS
from kmpc_lab.attacks.floods import EVERYTHING, FLOODS, SIZE
from kmpc_lab.attacks.trial import Trial, standstill
from kmpc_lab.attacks.watching import Turns, told
from kmpc_lite.cli.main import main


@pytest.mark.parametrize(
    "flood", [*FLOODS, *EVERYTHING.also], ids=lambda flood: f"{flood.surface.name}-{flood.name}"
)
def test_a_flood_has_its_attacker_and_enough_to_say(flood):
    assert (flood.beside or flood.surface.between) in KINDS
    assert flood.beside in ("hog", "idle") or 0.5 * SIZE < len(flood.rubbish()) < 2 * SIZE


def test_astandstill_is_found_in_a_trace(tmp_path):
    path = tmp_path / "trace"
    rows = [(k * 0.005, min(k, 400) * 0.0015) for k in range(600)]  # 0.3 m/s until 2.0 s
    path.write_text("".join(f"{100 + t:.4f} {x:.5f} 0\n" for t, x in rows))
    assert standstill(path, 101.5) == pytest.approx(0.5, abs=0.02)
    assert standstill(path, 102.5) == pytest.approx(0.0, abs=0.01)
    assert standstill(path, 102.98) == math.inf


def quick(monkeypatch):
    trials = []

    def run(surface, floods):
        trials.append((surface, floods))
        late = [0.001] * 99 + [0.03 if floods else 0.002]
        return Trial(late, 0.33 if floods else 0.3, 0.012, 5_000_000)

    monkeypatch.setattr("kmpc_lab.attacks.table.run", run)
    return trials


def test_the_command_drives_each_surface_once_in_peace_and_once_a_flood(monkeypatch, capsys):
    trials = quick(monkeypatch)
    assert main(["latency", "--flood", "pose socket", "0xfe"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 2 + 4 and len(trials) == 4 + 3
    assert lines[2] == "| MAVLink, TCP | 0xFE | 5.0 | 1.0 / 1.0 | 0.30 / 0.33 | 1.10 | 12 / 12 |"
    assert main(["latency", "--flood", "VESC", "--json"]) == 0
    row = json.loads(capsys.readouterr().out)[0]
    assert row["ratio"] == 1.1 and row["with"]["late_max_s"] == 0.03
    assert main(["latency", "--flood", "tsunami"]) == 2
    assert "no flood has this in" in capsys.readouterr().err


def test_what_browsers_cost_is_reported_as_one_ratio():
    turns = Turns(50, 4.0, Path("/"))
    for k in range(100):
        turns.late[False].add(0.001 + 1e-6 * k)
        turns.late[True].add(0.002 + 2e-6 * k)
    late, spacing = turns.table()
    assert late["ratio"] == pytest.approx(2.0, rel=0.03) and spacing["ratio"] is None
    text = told([late], 50)
    assert "with 50 browsers" in text and "p99 with / without: 2." in text
