"""Streams of different rates: aligned by time, cut where either is missing."""

import numpy as np
import pytest
from foreign_logs import drive

from kmpc_lite.learn.cutting import cut
from kmpc_lite.learn.formats.streams import Thinned
from kmpc_lite.learn.logs import Log, Series

DRIVE = drive(20.0, rate=50.0)


def streams(
    poses: np.ndarray | slice = slice(None), commands: np.ndarray | slice = slice(None)
) -> Log:
    """A log of the drive with some of its samples."""
    return Log(
        "bag",
        Series(DRIVE.time[poses], DRIVE.poses[poses], "/odom"),
        Series(DRIVE.command_time[commands], DRIVE.commands[commands], "/cmd_vel"),
    )


def test_rates_do_not_matter() -> None:
    fine, coarse = cut(streams(), dt=0.2)[0], cut(streams(slice(None, None, 5)), dt=0.2)[0]
    n = min(len(fine), len(coarse)) - 1
    np.testing.assert_allclose(fine.inputs[:n], coarse.inputs[:n], atol=1e-9)
    np.testing.assert_allclose(fine.states[:n], coarse.states[:n], atol=0.01)


def test_where_poses_or_commands_are_missing_an_episode_ends() -> None:
    kept = (DRIVE.time < 1005.0) | (DRIVE.time > 1007.0)
    assert [len(e) for e in cut(streams(np.flatnonzero(kept)), dt=0.1)] == [49, 129]
    told = (DRIVE.command_time < 1005.0) | (DRIVE.command_time > 1010.0)
    first, second = cut(streams(commands=np.flatnonzero(told)), dt=0.1)
    assert len(first) * 0.1 == pytest.approx(6.0, abs=0.3)  # held for a second, not for ever
    assert len(second) * 0.1 == pytest.approx(9.8, abs=0.3)


def test_a_stream_never_grows_beyond_its_bound() -> None:
    stream = Thinned(2, 0.01, most=1000)
    for k in range(20_000):
        if stream.wants(0.005 * k):
            stream.add(0.005 * k, k, -k)
    rows = stream.rows()
    assert 300 <= len(rows) <= 1000
    assert rows[0, 0] == 0.0 and rows[-1, 0] > 99.0 and np.diff(rows[:, 0]).min() >= 0.01
    np.testing.assert_allclose(rows[:, 1], rows[:, 0] / 0.005)
