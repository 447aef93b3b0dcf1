"""Streams of different rates: aligned by time, cut where either is missing."""

from __future__ import annotations

import numpy as np
import pytest
from foreign_logs import drive

import kmpc_lite as kl
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


def test_commands_act_from_when_they_came() -> None:
    (episode,) = cut(streams(), dt=0.05)
    wanted = np.interp(1000.0 + 0.05 * np.arange(len(episode) + 1), DRIVE.time, DRIVE.poses[:, 0])
    np.testing.assert_allclose(episode.states[:, 0], wanted, atol=1e-9)
    np.testing.assert_allclose(episode.inputs[::2][:150], DRIVE.commands[:150], atol=1e-9)


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


def test_headings_that_wrap_do_not_jump() -> None:
    log = streams()
    wrapped = log.poses.values.copy()
    wrapped[:, 2] = np.remainder(wrapped[:, 2] + np.pi, 2 * np.pi) - np.pi
    other = Log("bag", Series(log.poses.time, wrapped, ""), log.commands)
    np.testing.assert_allclose(
        np.diff(cut(other, dt=0.1)[0].states[:, 2]),
        np.diff(cut(log, dt=0.1)[0].states[:, 2]),
        atol=1e-9,
    )


def test_no_overlap_says_when_each_came() -> None:
    log = streams()
    late = Log("bag", log.poses, Series(log.commands.time + 500.0, log.commands.values, ""))
    with pytest.raises(kl.DataError, match="poses from 1000 to 1019.98 s, commands from 1500 to"):
        cut(late, dt=0.1)


def test_a_stream_never_grows_beyond_its_bound() -> None:
    stream = Thinned(2, 0.01, most=1000)
    for k in range(20_000):
        if stream.wants(0.005 * k):
            stream.add(0.005 * k, k, -k)
    rows = stream.rows()
    assert 300 <= len(rows) <= 1000 and stream.seen == 20_000
    assert rows[0, 0] == 0.0 and rows[-1, 0] > 99.0 and np.diff(rows[:, 0]).min() >= 0.01
    np.testing.assert_allclose(rows[:, 1], rows[:, 0] / 0.005)
