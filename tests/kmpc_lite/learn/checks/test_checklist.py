"""Valid logs of all sorts of robots pass; what is wrong with a log is named, with what mends it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import drive, rows
from valid_logs import KINDS, WRONG, as_log, valid

import kmpc_lite as kl
from kmpc_lite.learn.checks.checklist import Suspect, judge
from kmpc_lite.learn.formats.readers import read_log
from kmpc_lite.learn.logs import Log, ReadOptions, correct

REAL = Path(__file__).parents[5] / "shared" / "data" / "norlab_drive"


def suspects_of(log: Log) -> list[Suspect]:
    return list(judge(log).suspects)


@pytest.mark.parametrize("kind", KINDS)
def test_a_valid_log_passes(kind: str) -> None:
    for seed in (1001, 1002):
        assert suspects_of(valid(seed, kind).log) == []


@pytest.mark.long
def test_at_most_one_valid_log_in_a_hundred_is_refused() -> None:
    refused = [seed for seed in range(500) if suspects_of(valid(seed).log)]
    assert len(refused) <= 5, refused


@pytest.mark.parametrize("wrong", WRONG)
def test_what_is_wrong_is_named(wrong: str) -> None:
    change, told = WRONG[wrong]
    table = rows(drive(90.0, rate=20.0, seed=3, delay=0.15, lag=0.1, noise=(0.003, 0.003)))
    reasons = [s.reason for s in suspects_of(as_log(change(table.copy())))]
    assert any(told in reason for reason in reasons), reasons
    assert all("\n" not in reason for reason in reasons)


@pytest.mark.parametrize(
    "wrong", ["ms", "ns", "mm", "theta deg", "omega deg", "mirrored", "compass", "ned", "a quarter"]
)
def test_the_option_that_is_named_mends_it(wrong: str) -> None:
    change, _ = WRONG[wrong]
    log = as_log(change(rows(drive(90.0, rate=20.0, seed=4, noise=(0.003, 0.003)))))
    for _ in range(3):
        found = suspects_of(log)
        if not found:
            break
        reason = found[0].reason
        units = re.search(r"--units ((?:\w+=[^\s;),]+ ?)+)", reason)
        frame = re.search(r"--frame (\w+)", reason)
        pairs = dict(word.split("=") for word in units[1].split()) if units and not frame else {}
        log = correct(log, ReadOptions(units=pairs, frame=frame[1] if frame else "enu"))
    assert suspects_of(log) == []


ALIKE = ("all mm", "y mirrored", "unrelated", "exchanged", "km/h", "feet", "no sign")
"""What may be meant: a slow robot in mm is a fast one in m, one that is told km/h or feet makes a
third of what it is told, and who hardly turns, or hardly reverses, looks alike without the sign."""


@pytest.mark.long
def test_wrong_logs_of_all_sorts_of_robots() -> None:
    missed = []
    for seed in range(0, 160, 5):
        for wrong, (change, _) in WRONG.items():
            made = valid(seed)
            if not suspects_of(as_log(change(made.table.copy()))):
                missed.append((seed, made.kind, wrong))
    count = len(WRONG) * 32
    assert len(missed) <= 0.05 * count, missed
    unexplained = [miss for miss in missed if miss[2] not in ALIKE]
    assert len(unexplained) <= 0.01 * count, unexplained
    # and these, too, are seen on most robots
    for wrong in ALIKE:
        assert sum(miss[2] == wrong for miss in missed) <= 0.4 * 32, (wrong, missed)


@pytest.mark.skipif(not REAL.is_dir(), reason="needs the logs in ../shared/data/norlab_drive")
@pytest.mark.parametrize("robot", ["husky", "warthog"])
def test_real_skid_steered_robots_pass(robot: str) -> None:
    assert suspects_of(read_log(REAL / f"{robot}.csv")) == []


def test_a_refusal_is_one_line_with_the_file_and_the_way_on() -> None:
    table = rows(drive(60.0, rate=20.0, seed=5))
    both = as_log(table * [1, 1, 1, 180 / np.pi, 1, 180 / np.pi])
    with pytest.raises(
        kl.DataError, match=r"^run.csv .*--units theta=deg \(1 more: kmpc inspect\)"
    ):
        judge(both).refuse(both)


def test_too_little_to_judge_is_not_judged() -> None:
    assert suspects_of(as_log(rows(drive(1.0, rate=20.0)))) == []


@pytest.mark.parametrize("delay", [0.1, 0.35, 0.8])
def test_the_delay_is_estimated(delay: float) -> None:
    table = rows(drive(90.0, rate=20.0, seed=6, delay=delay, noise=(0.003, 0.003)))
    assert judge(as_log(table)).delay == pytest.approx(delay, abs=0.05)


def at_one_speed(seed: int) -> np.ndarray:
    """Two minutes at 0.5 m/s, turning this way and that, 0.2 s late."""
    made = drive(120.0, 5.0, seed, delay=0.2, speeds=(0.0, 1.2), noise=(0.0, 1e-4))
    path = np.cumsum(0.5 / 5.0 * np.exp(1j * made.poses[:, 2]))
    table = rows(made)
    table[:, 1:3] = np.column_stack([path.real, path.imag])
    table[:, 4] = 0.5
    return table


def test_the_delay_is_that_of_a_command_that_changes() -> None:
    for seed in range(8):
        verdict = judge(as_log(at_one_speed(seed)))
        assert verdict.suspects == ()
        assert verdict.delay == pytest.approx(0.2, abs=0.1)
    always = at_one_speed(0)
    always[:, 5] = 0.1
    assert judge(as_log(always)) == ((), None)


def test_v_and_omega_exchanged_are_not_taken_for_wheels() -> None:
    for seed in range(5):
        table = rows(drive(120.0, 20.0, seed, speeds=(0.6, 1.5), noise=(0.002, 0.002), delay=0.2))
        reasons = [s.reason for s in suspects_of(as_log(table[:, [0, 1, 2, 3, 5, 4]]))]
        assert "exchanged" in reasons[0] and not any("wheels" in r for r in reasons), reasons


def test_a_table_whose_clock_begins_again_is_judged_in_its_own_order() -> None:
    for seed in range(16):
        table = valid(seed).table
        sessions = table.copy()
        for row in (len(table) // 3, 2 * len(table) // 3):
            sessions[row:, 0] -= sessions[row, 0] - sessions[0, 0]
        verdict, whole = judge(as_log(sessions)), judge(as_log(table))
        assert verdict.suspects == ()
        assert verdict.delay == pytest.approx(whole.delay, abs=0.02)
