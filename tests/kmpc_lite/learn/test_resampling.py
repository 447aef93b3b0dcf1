"""Drives are cut and resampled without losing a step."""

from typing import Any

import numpy as np
import pytest
from any_episode import numbered, owner, wandering

import kmpc_lite as kl


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
