"""Logs of other people's tools hold the same drive, whatever their format."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from foreign_logs import (
    Drive,
    drive,
    write_bag,
    write_csv,
    write_dataflash,
    write_euroc,
    write_tlog,
    write_tum,
    write_ulog,
)

import kmpc_lite as kl
from kmpc_lite.learn.formats.readers import find_logs, read_log, reader_of
from kmpc_lite.learn.formats.rosbag import TWIST
from kmpc_lite.learn.formats.ulog import _Bounded
from kmpc_lite.learn.logs import ReadOptions

DRIVE = drive(12.0)
QUIET = DRIVE._replace(command_time=DRIVE.command_time[:0], commands=DRIVE.commands[:0])
COMMANDS = {"a.tum": "a.commands.csv", "e.csv": "e.commands.csv"}
WRITERS: dict[str, Callable[[Path, Drive], Path]] = {
    "run.csv": write_csv,
    "sqlite": write_bag,
    "mcap": lambda p, d: write_bag(p, d, "mcap", commands=f"{TWIST}Stamped"),
    "poses": lambda p, d: write_bag(p, d, "mcap", pose="pose"),
    "tf": lambda p, d: write_bag(p, d, pose="tf"),
    "one.bag": lambda p, d: write_bag(p, d, "ros1"),
    "two.bag": lambda p, d: write_bag(p, d, "ros1", pose="tf", commands=f"{TWIST}Stamped"),
    "a.bin": write_dataflash,
    "pos.bin": lambda p, d: write_dataflash(p, d, "POS"),
    "a.tlog": write_tlog,
    "a.ulg": write_ulog,
    "a.tum": write_tum,
    "e.csv": write_euroc,
}


def load(folder: Path, name: str, made: Path, **how: Any) -> kl.Dataset:
    beside = folder / COMMANDS[name] if name in COMMANDS else None
    return kl.Dataset.load(made, dt=0.1, commands=beside, **how)


@pytest.mark.parametrize("name", WRITERS)
def test_the_drive_is_the_same_in_every_format(tmp_path: Path, name: str) -> None:
    made = WRITERS[name](tmp_path / name, DRIVE)
    (episode,) = load(tmp_path, name, made).episodes
    log = read_log(
        made, ReadOptions(commands=tmp_path / COMMANDS[name] if name in COMMANDS else None)
    )
    # GPS positions are logged to 1e-7 degrees, a centimetre
    exact = 0.02 if name == "pos.bin" else 2e-3
    offset = log.poses.time[0] - DRIVE.time[0] if not log.together else 0.0
    first = DRIVE.time[0] + (0.02 if len(episode) < 119 else 0.0)
    assert len(episode) >= 118 and abs(offset) < 1e-6
    time = first + 0.1 * np.arange(len(episode) + 1)
    for column, true in zip(episode.states.T, DRIVE.poses.T, strict=True):
        wanted = np.interp(time, DRIVE.time, true)
        moved, expected = column - column[0], wanted - wanted[0]
        assert np.abs(moved - expected).max() < 0.03 + exact
    held = DRIVE.commands[np.searchsorted(DRIVE.command_time, time[:-1] + 1e-6) - 1]
    assert (np.abs(episode.inputs - held) < 0.02).all(axis=1).mean() > 0.85
    assert np.abs(np.remainder(episode.states[0, 2] - 0.3 + np.pi, 2 * np.pi) - np.pi) < 0.05


def test_a_file_without_an_ending_is_known_by_its_first_bytes(tmp_path: Path) -> None:
    write_dataflash(tmp_path / "00000012.log1", DRIVE)
    assert reader_of(tmp_path / "00000012.log1").what == "an ArduPilot log"
    assert kl.Dataset.load(tmp_path / "00000012.log1").dt == 0.1


def test_a_folder_means_the_logs_in_it(tmp_path: Path) -> None:
    folder = tmp_path / "drives"
    folder.mkdir()
    write_csv(folder / "a.csv", DRIVE)
    write_bag(folder / "bag", DRIVE)
    (folder / "notes.md").write_text("sunny\n")
    assert [p.name for p in find_logs([folder])] == ["a.csv", "bag"]
    assert len(kl.Dataset.load(folder, dt=0.1)) == 2
    with pytest.raises(kl.DataError, match="a folder without a log"):
        (tmp_path / "empty").mkdir()
        kl.Dataset.load(tmp_path / "empty")


def test_topics_are_chosen_where_several_could_be_meant(tmp_path: Path) -> None:
    two = write_bag(tmp_path / "two", DRIVE, odoms=["/left/odom", "/right/odom"])
    with pytest.raises(kl.DataError, match="2 topics.*--topics odom=/left/odom"):
        kl.Dataset.load(two)
    assert kl.Dataset.load(two, topics={"odom": "/right/odom"}).steps > 100
    for chosen, told in (
        ({"odom": "/odometry"}, "no such topic"),
        ({"odom": "/note"}, "it is std_msgs/msg/String"),
        ({"pose": "/odom"}, "expected odom=... or cmd=..."),
    ):
        with pytest.raises(kl.DataError, match=told):
            kl.Dataset.load(two, topics=chosen)
    usual = write_bag(tmp_path / "usual", DRIVE, cmds=["/cmd_vel", "/cmd_vel_nav"])
    assert "commands: /cmd_vel (" in read_log(usual).notes[0]


def test_odometry_alone_gives_measured_speeds_and_says_so(tmp_path: Path) -> None:
    made = write_bag(tmp_path / "bag", QUIET, cmds=[])
    log = read_log(made)
    assert any("measured speeds" in note for note in log.notes)
    np.testing.assert_allclose(log.commands.values, 0.1)


def test_stamps_of_another_clock_are_not_used(tmp_path: Path) -> None:
    made = write_bag(tmp_path / "bag", DRIVE, clock=-900.0)
    log = read_log(made)
    np.testing.assert_allclose(log.poses.time, DRIVE.time, atol=1e-6)


def test_an_empty_topic_is_named(tmp_path: Path) -> None:
    made = write_bag(tmp_path / "bag", QUIET, pose="tf")
    with pytest.raises(kl.DataError, match="no topic with a command.*/cmd_vel: no messages"):
        kl.Dataset.load(made)


def test_outputs_stand_in_for_speeds_and_that_is_reported(tmp_path: Path) -> None:
    log = read_log(write_dataflash(tmp_path / "a.bin", DRIVE, desired=False))
    assert any("shares of full throttle" in note for note in log.notes)
    np.testing.assert_allclose(log.commands.values[-1] * [1.0, 2.0], DRIVE.commands[-1], atol=1e-3)


def test_sticks_stand_in_for_set_points_and_that_is_reported(tmp_path: Path) -> None:
    log = read_log(write_tlog(tmp_path / "a.tlog", DRIVE, "sticks"))
    assert any("shares of full throttle" in note for note in log.notes)
    np.testing.assert_allclose(log.commands.values[-1] * [1.0, 2.0], DRIVE.commands[-1], atol=0.01)


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("a.bin", b"", "not an ArduPilot log"),
        ("a.tlog", bytes(range(256)) * 50, "a.tlog"),
        ("a.ulg", b"ULog", "not a PX4 log"),
        ("a.ulg", b"ULog\x01\x12\x35\x01" + bytes(8), "no pose is logged"),
        ("a.xyz", b"hello", "unknown log format"),
    ],
)
def test_what_is_no_log_is_one_line(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], name: str, content: bytes, told: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(kl.DataError, match=told) as caught:
        kl.Dataset.load(tmp_path / name)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "ending", ["csv", "npz", "tum", "bin", "tlog", "ulg", "bag", "mcap", "db3"]
)
def test_pipes_and_devices_are_not_opened(tmp_path: Path, ending: str) -> None:
    os.mkfifo(tmp_path / f"pipe.{ending}")
    (tmp_path / f"zero.{ending}").symlink_to("/dev/zero")
    for name in ("pipe", "zero"):
        with pytest.raises(kl.DataError, match="not a regular file"):
            kl.Dataset.load(tmp_path / f"{name}.{ending}")


def test_options_that_nothing_heeds_are_refused(tmp_path: Path) -> None:
    made = write_dataflash(tmp_path / "a.bin", DRIVE)
    for how, told in (
        ({"columns": {"t": "x"}}, "none of the logs is a table"),
        ({"commands": tmp_path / "c.csv"}, "--commands goes with tables of poses"),
        ({"topics": {"odom": "NKF1"}}, "odom=NKF1: not logged; here are XKF1"),
    ):
        with pytest.raises(kl.DataError, match=told):
            kl.Dataset.load(made, **how)


def test_a_damaged_px4_log_is_not_read_for_ever(tmp_path: Path) -> None:
    """pyulog goes back from the end of some damaged logs again and again."""
    (tmp_path / "log.ulg").write_bytes(10 * b"log")
    with (tmp_path / "log.ulg").open("rb") as file:
        bounded = _Bounded(file)
        with pytest.raises(OSError, match="no end"):
            while True:
                bounded.seek(0)
                assert bounded.read(30) == 10 * b"log"


@pytest.mark.parametrize("name", ["a.bin", "a.tlog"])
def test_torn_and_bent_logs_never_do_more_than_refuse(tmp_path: Path, name: str) -> None:
    whole = WRITERS[name](tmp_path / name, drive(3.0)).read_bytes()
    random = np.random.default_rng(0)
    for trial in range(25):
        bent = bytearray(whole[: int(random.uniform(0.1, 1.0) * len(whole))])
        for _ in range(trial):
            bent[random.integers(len(bent))] = random.integers(256)
        (tmp_path / name).write_bytes(bent)
        try:
            kl.Dataset.load(tmp_path / name)
        except kl.DataError as error:
            assert "\n" not in str(error)
