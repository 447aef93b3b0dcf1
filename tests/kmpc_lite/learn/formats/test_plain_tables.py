"""Tables as they are at hand: dates for times, wheels for commands, places on Earth, holes."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import drive, rows

import kmpc_lite as kl
from kmpc_lite.learn.formats.readers import read_log
from kmpc_lite.learn.loading import inspect
from kmpc_lite.learn.logs import ReadOptions
from kmpc_lite.types import Array

TABLE = rows(drive(20.0, rate=20.0))
HEADER = "t,x,y,theta,v,omega"
TRACK = 0.4


def write(path: Path, header: str, table: list[list[object]]) -> Path:
    """A table of whatever its values are."""
    path.write_text("\n".join([header, *(",".join(map(str, row)) for row in table), ""]))
    return path


def as_lists(table: Array) -> list[list[object]]:
    return [list(row) for row in table.tolist()]


FORMS = "%Y-%m-%dT%H:%M:%S.%fZ", "%Y-%m-%d %H:%M:%S.%f", "%Y/%m/%d/%H:%M:%S.%f", "%H:%M:%S.%f"


@pytest.mark.parametrize("form", FORMS)
def test_times_may_be_dates(tmp_path: Path, form: str) -> None:
    begin, table = datetime(2026, 3, 29, 0, 59, 50, tzinfo=UTC), as_lists(TABLE)
    for row in table:
        row[0] = (begin + timedelta(seconds=float(row[0]))).strftime(form)  # type: ignore[arg-type]
    log = read_log(write(tmp_path / "run.csv", HEADER, table))
    np.testing.assert_allclose(log.poses.time - log.poses.time[0], TABLE[:, 0], atol=2e-6)
    np.testing.assert_allclose(log.commands.values, TABLE[:, 4:])
    table[7][0] = "yesterday"
    write(tmp_path / "run.csv", HEADER, table)
    with pytest.raises(kl.DataError, match="line 9, column t: expected a number, got 'yesterday'"):
        read_log(tmp_path / "run.csv")


@pytest.mark.parametrize("names", ["left,right", "cmd.left_wheel_speed,cmd.right_wheel_speed"])
def test_commands_may_be_those_of_two_wheels(tmp_path: Path, names: str) -> None:
    v, omega = TABLE[:, 4], TABLE[:, 5]
    wheels = np.column_stack([v - 0.5 * TRACK * omega, v + 0.5 * TRACK * omega])
    made = write(
        tmp_path / "run.csv",
        f"t,x,y,theta,{names}",
        as_lists(np.column_stack([TABLE[:, :4], 1e3 * wheels])),
    )
    with pytest.raises(kl.DataError, match="of a left and a right wheel: --track M"):
        read_log(made)
    units = {"left": "mm/s", "right": "mm/s"}
    log = read_log(made, ReadOptions(track=TRACK, units=units))
    np.testing.assert_allclose(log.commands.values, TABLE[:, 4:], atol=1e-12)
    data = kl.Dataset.load(made, track=TRACK, units=units)
    assert data.steps == len(TABLE) - 1
    with pytest.raises(kl.DataError, match="track: expected a distance > 0 m"):
        ReadOptions(track=0.0)


def test_positions_may_be_latitude_and_longitude(tmp_path: Path) -> None:
    earth, north = 6_378_137.0, np.radians(52.0)
    place = np.column_stack(
        [
            np.degrees(north + TABLE[:, 2] / earth),
            13.0 + np.degrees(TABLE[:, 1] / (earth * np.cos(north))),
        ]
    )
    table = np.column_stack([TABLE[:, 0], place, TABLE[:, 3:]])
    made = write(tmp_path / "run.csv", "t,latitude,longitude,yaw,v,omega", as_lists(table))
    log = read_log(made)
    moved = TABLE[:, 1:3] - TABLE[0, 1:3]
    np.testing.assert_allclose(log.poses.values[:, :2], moved, atol=1e-3)
    assert not inspect(made).suspects


def test_rows_with_a_value_missing_are_left_out_and_counted(tmp_path: Path) -> None:
    table = as_lists(TABLE)
    for row, hole in ((3, ""), (50, "nan"), (51, "NULL"), (90, "N/A")):
        table[row][4] = hole
    table[120][1] = "NaN"
    made = write(tmp_path / "run.csv", HEADER, table)
    log = read_log(made)
    assert len(log.poses.time) == len(TABLE) - 5
    assert "5 rows without a number in x, v were left out" in log.notes
    assert log.where(3) == "line 6" and log.where(200) == f"line {200 + 5 + 2}"
    # a hole of two rows is longer than a gap may be, and no drive goes on across it
    assert max(map(len, kl.Dataset.load(made, dt=0.1, gap=0.1).episodes)) < len(TABLE) / 2
    table[8][5] = "inf"
    write(tmp_path / "run.csv", HEADER, table)
    with pytest.raises(kl.DataError, match="line 10, column omega: expected a finite number"):
        read_log(made)


def test_poses_and_commands_may_stand_in_rows_of_their_own(tmp_path: Path) -> None:
    t, table = TABLE[:, 0].tolist(), as_lists(TABLE)
    poses = [[*row[:4], "", "", ""] for row in table]
    commands = [[a - 0.003, "", "", "", *row[4:], ""] for a, row in zip(t, table, strict=True)]
    others = [[a + 0.001 * k, "", "", "", "", "", 12.1] for a in t for k in (5, 15, 25)]
    mixed = sorted([*poses, *commands[::2], *others], key=lambda row: row[0])
    log = read_log(write(tmp_path / "run.csv", f"{HEADER},battery", mixed))
    np.testing.assert_allclose(log.poses.values, TABLE[:, 1:4])
    np.testing.assert_allclose(log.commands.values, TABLE[::2, 4:])
    np.testing.assert_allclose(log.commands.time, TABLE[::2, 0] - 0.003)
    assert log.where(1) == "line 7" and not inspect(tmp_path / "run.csv").suspects


def test_a_clock_may_be_nanoseconds_or_seconds_and_nanoseconds(tmp_path: Path) -> None:
    clock = [1_767_225_600_000_000_000 + round(1e9 * t) for t in TABLE[:, 0]]
    for name, stamps in (
        ("t", [[t] for t in clock]),
        ("stamp.sec,stamp.nanosec", [divmod(t, 1_000_000_000) for t in clock]),
    ):
        table = [[*t, *row[1:]] for t, row in zip(stamps, as_lists(TABLE), strict=True)]
        made = write(tmp_path / "run.csv", HEADER.replace("t", name, 1), table)
        log = read_log(made)
        np.testing.assert_allclose(log.poses.time - log.poses.time[0], TABLE[:, 0], atol=1e-5)
        assert "columns: t=" in log.notes[0] and not inspect(made).suspects
