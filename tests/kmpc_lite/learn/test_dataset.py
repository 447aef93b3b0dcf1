"""Episodes and datasets: checked, saved, split, never differenced across a gap."""

from __future__ import annotations

import csv
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from any_episode import HEADER, numbered, owner, wandering

import kmpc_lite as kl

# episodes

STATES, INPUTS = np.zeros((5, 3)), np.zeros((4, 2))


@pytest.mark.parametrize(
    ("states", "inputs", "dt", "words"),
    [
        (STATES[:1], INPUTS[:0], 0.1, r"states: expected shape \(T \+ 1, 3\).*got \(1, 3\)"),
        ("drive.csv", INPUTS, 0.1, "states: expected an array of real numbers"),
        (
            STATES,
            np.zeros((5, 2)),
            0.1,
            r"inputs: expected shape \(4, 2\), one row per step, got \(5, 2\)",
        ),
        (STATES, INPUTS, 0.0, "dt: expected a time > 0 s, got 0"),
        (
            np.where(np.arange(15).reshape(5, 3) == 10, np.nan, 0.0),
            INPUTS,
            0.1,
            "states: row 3, column 1 is nan",
        ),
    ],
)
def test_what_makes_no_episode(states: Any, inputs: Any, dt: Any, words: str) -> None:
    with pytest.raises(kl.DataError, match=words):
        kl.Episode(states, inputs, dt)


def test_a_log_that_turns_is_unwrapped_and_starts_within_half_a_turn(tmp_path: Path) -> None:
    true = np.linspace(3.0, 25.0, 120)
    np.savez(
        tmp_path / "run.npz",
        **{
            n: np.angle(np.exp(1j * true)) if n == "theta" else 0.1 * np.arange(120.0)
            for n in HEADER.split(",")
        },
    )
    for shift in (0.0, 6 * np.pi):
        np.savez(
            tmp_path / "run.npz",
            **{
                n: np.angle(np.exp(1j * true)) + shift if n == "theta" else 0.1 * np.arange(120.0)
                for n in HEADER.split(",")
            },
        )
        for dt in (None, 0.1):
            theta = kl.Dataset.load(tmp_path / "run.npz", dt=dt).episodes[0].states[:, 2]
            np.testing.assert_allclose(theta, true, atol=1e-9)
            assert abs(theta[0]) <= np.pi


def test_a_dataset_needs_episodes_of_one_period() -> None:
    drive = kl.Episode(np.zeros((3, 3)), np.zeros((2, 2)), 0.1)
    for wrong in (drive, np.zeros((3, 3)), [np.zeros((3, 3))], ["run.csv"], "run.csv"):
        with pytest.raises(kl.DataError, match="a list of episodes"):
            kl.Dataset(wrong)  # type: ignore[arg-type]
    assert len(kl.Dataset(e for e in [drive, drive])) == 2  # type: ignore[arg-type]
    with pytest.raises(kl.DataError, match="at least one episode"):
        kl.Dataset([])
    with pytest.raises(kl.DataError, match=r"different periods \(0.1 to 0.2 s\)"):
        kl.Dataset([numbered(5, 1), numbered(5, 2, dt=0.2)])
    assert kl.Dataset([numbered(5, 1), numbered(5, 2, dt=0.1 * (1 + 1e-9))]).steps == 10
    assert (
        repr(kl.Dataset([numbered(300, 1), numbered(300, 2)]))
        == "Dataset(2 episodes, 600 steps of 0.1 s, 1.0 min)"
    )


@pytest.mark.parametrize("ending", ["csv", "npz"])
@pytest.mark.parametrize("dt", [0.1, 1 / 30, 0.005, 20.0])
def test_a_saved_dataset_comes_back(tmp_path: Path, ending: str, dt: float) -> None:
    drives = [wandering(steps, dt, seed) for seed, steps in enumerate([40, 1, 3, 500])]
    kl.Dataset(drives).save(tmp_path / f"run.{ending}")
    back = kl.Dataset.load(tmp_path / f"run.{ending}", force=True)
    assert back.dt == pytest.approx(dt, rel=1e-8) and len(back) == len(drives)
    for mine, theirs in zip(drives, back.episodes, strict=True):
        np.testing.assert_array_equal(mine.states, theirs.states)
        np.testing.assert_array_equal(mine.inputs, theirs.inputs)
    if ending == "csv":
        with open(tmp_path / "run.csv", newline="") as file:
            assert next(csv.reader(file)) == HEADER.split(",")


@pytest.mark.parametrize(
    "name",
    ["missing/run.csv", "old.npz/run.npz", "n" * 300 + ".csv", "bad\0name.npz", "folder.csv"],
)
def test_a_log_that_cannot_be_written_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.chdir(tmp_path)
    data = kl.Dataset([wandering(5, 0.1)])
    data.save("old.npz")
    os.mkdir("folder.csv")
    before = Path("old.npz").read_bytes()
    with pytest.raises(kl.DataError, match="cannot write the log"):
        data.save(name)
    with pytest.raises(kl.DataError, match="unknown log format"):
        data.save("run.txt")
    assert (
        sorted(os.listdir()) == ["folder.csv", "old.npz"] and Path("old.npz").read_bytes() == before
    )


def test_gaps_end_an_episode(tmp_path: Path) -> None:
    time = np.r_[0.0, 0.1, 0.2, 0.3, 0.56, 0.66, 5.0, 9.0, 9.1]
    rows = np.arange(9.0)
    np.savez(tmp_path / "run.npz", **{n: time if n == "t" else rows for n in HEADER.split(",")})
    # 0.26 s is more than 2.5 periods, and a row between two gaps is no episode
    assert [e.states[:, 0].tolist() for e in kl.Dataset.load(tmp_path / "run.npz").episodes] == [
        [0, 1, 2, 3],
        [4, 5],
        [7, 8],
    ]
    bridged = kl.Dataset.load(tmp_path / "run.npz", dt=0.1, gap=0.3)
    assert [len(e) for e in bridged.episodes] == [6, 1]
    with pytest.raises(kl.DataError, match="uneven sampling, a step of 0.26 s"):
        kl.Dataset.load(tmp_path / "run.npz", gap=0.3)


@pytest.mark.parametrize("fraction", [0.0, 1.0, -0.5, 2.0, float("nan")])
def test_a_share_that_is_none_is_refused(fraction: float) -> None:
    with pytest.raises(kl.DataError, match="share between 0 and 1"):
        kl.Dataset([numbered(5, k) for k in range(4)]).split(fraction)


@pytest.mark.parametrize("history", [0, 1, 3])
@pytest.mark.parametrize("chunk", [1, 4, 7, 8192])
def test_transitions_never_cross_the_beginning_of_an_episode(history: int, chunk: int) -> None:
    data = kl.Dataset([numbered(steps, number) for number, steps in enumerate([9, 2, 3, 4, 17])])
    parts = list(data.transitions(history, chunk))
    x, u, x_next = (
        np.concatenate([getattr(p, name) for p in parts]) for name in ("x", "u", "x_next")
    )
    expected = [1000 * n + k for n, e in enumerate(data.episodes) for k in range(history, len(e))]
    assert (
        x[:, 0].tolist() == expected
        and u[:, 0].tolist() == expected
        and u[:, 1].tolist() == [-e for e in expected]
    )
    np.testing.assert_allclose(x_next - x, np.tile([1.0, 1.0, 0.001], (len(x), 1)), atol=1e-9)
    if history:
        past = np.concatenate([p.history for p in parts if p.history is not None])
        assert past.shape == (len(x), history, 2)
        # oldest first, the last row the command before
        np.testing.assert_array_equal(past[:, :, 0], x[:, :1] - np.arange(history, 0, -1))
    else:
        assert all(p.history is None for p in parts)
    assert max(len(p.x) for p in parts) < 2 * chunk


def test_windows_cut_without_losing_a_step() -> None:
    data = kl.Dataset([numbered(25, 1), numbered(10, 2), numbered(3, 3)])
    pieces = data.windows(1.0)
    assert [len(e) for e in pieces.episodes] == [10, 10, 5, 10, 3] and pieces.steps == data.steps
    assert owner(pieces) == [1, 1, 1, 2, 3]
    np.testing.assert_array_equal(pieces.episodes[1].states[0], pieces.episodes[0].states[-1])
    assert (
        np.concatenate([e.inputs for e in pieces.episodes]).tolist()
        == np.concatenate([e.inputs for e in data.episodes]).tolist()
    )
    assert max(len(e) for e in data.windows(0.19).episodes) == 1  # at most so many seconds
    assert len(data.windows(1e9)) == 3
    for seconds in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(kl.DataError, match="windows: expected a time"):
            data.windows(seconds)


@pytest.mark.parametrize("dt", [0.05, 0.2, 0.3, 0.5, 1.0])
def test_resampling_conserves_what_was_commanded(dt: float) -> None:
    drive = wandering(60, 0.1)
    again = drive.resample(dt)
    assert again is not None
    covered = int(round(len(again) * dt / 0.1))
    np.testing.assert_allclose(
        again.inputs.sum(axis=0) * dt, drive.inputs[:covered].sum(axis=0) * 0.1, atol=1e-9
    )
    if dt >= 0.1:  # and each new command is the mean of those that it stands for
        each = int(round(dt / 0.1))
        np.testing.assert_allclose(
            again.inputs, drive.inputs[:covered].reshape(-1, each, 2).mean(axis=1), atol=1e-9
        )
        np.testing.assert_allclose(again.states, drive.states[: covered + 1 : each], atol=1e-9)


def test_more_than_half_a_turn_within_a_period_is_refused() -> None:
    # the heading of an episode is unwrapped, so 4 rad would silently become -2.28 rad
    turning = kl.Episode(
        np.c_[np.zeros((31, 2)), 0.4 * np.arange(31)], np.tile([0.0, 4.0], (30, 1)), 0.1
    )
    again = turning.resample(0.7)
    assert again is not None
    np.testing.assert_allclose(np.diff(again.states[:, 2]), 2.8, atol=1e-12)
    with pytest.raises(
        kl.DataError, match="within 1 s the robot turns by 4.00 rad, more than half a turn"
    ):
        turning.resample(1.0)


def test_what_is_too_short_for_the_period_is_left_out() -> None:
    data = kl.Dataset([numbered(3, 1), numbered(30, 2)])
    assert numbered(3, 1).resample(0.5) is None
    assert owner(data.resample(0.5)) == [2]
    with pytest.raises(kl.DataError, match="as long as one period of 10 s"):
        data.resample(10.0)
    assert data.resample(0.1) is data


@pytest.mark.parametrize("dt", [0.0, -0.1, float("nan"), float("inf"), "fast"])
def test_an_impossible_period_is_refused(dt: Any) -> None:
    for drives in (numbered(5, 1), kl.Dataset([numbered(5, 1)])):
        with pytest.raises(kl.DataError, match="dt: expected"):
            drives.resample(dt)
    with pytest.raises(kl.DataError, match="more than 10,000,000 steps"):
        numbered(5, 1).resample(1e-9)
