"""Tables of other people: names, delimiters, units in the header, quaternions."""

from pathlib import Path

import numpy as np
import pytest
from foreign_logs import drive, rows

import kmpc_lite as kl
from kmpc_lite.geometry import heading_of
from kmpc_lite.learn.formats.readers import read_log
from kmpc_lite.learn.logs import ReadOptions

TABLE = rows(drive(4.0, rate=20.0))
DIALECTS = {
    "time;x;y;yaw;cmd_v;cmd_w": ";",
    "stamp\tpos_x\tpos_y\theading\tlinear\tangular": "\t",
    "%time,field.pose.pose.position.x,field.pose.pose.position.y,yaw,field.cmd.linear.x,"
    "field.cmd.angular.z": ",",
    "/odom/header/stamp|/odom/position/x|/odom/position/y|/odom/yaw|/cmd_vel/linear/x|"
    "/cmd_vel/angular/z": "|",
    "t x y theta v omega": " ",
    "t_s,x_m,y_m,psi_rad,v_mps,w_rad_s": ",",
    "datetime,x,y,yaw,cmdVelLinear,target_yaw_rate": ",",
    "Timestamp [s], X [m], Y [m], Theta [rad], V [m/s], Omega [rad/s]": ",",
}


def written(path: Path, header: str, delimiter: str, table: np.ndarray = TABLE) -> Path:
    lines = [delimiter.join(f"{v:.9f}" for v in row) for row in table]
    path.write_text("\n".join([header, *lines, ""]))
    return path


@pytest.mark.parametrize(("header", "delimiter"), DIALECTS.items())
def test_a_table_is_known_by_any_header(tmp_path: Path, header: str, delimiter: str) -> None:
    log = read_log(written(tmp_path / "run.csv", header, delimiter))
    np.testing.assert_allclose(log.poses.values, TABLE[:, 1:4], atol=1e-8)
    np.testing.assert_allclose(log.commands.values, TABLE[:, 4:], atol=1e-8)


def test_units_in_the_header_are_taken_and_reported(tmp_path: Path) -> None:
    header = "stamp_ns,x [mm],y [mm],yaw [°],v [km/h],omega (deg/s)"
    scale = [1e9, 1e3, 1e3, 180 / np.pi, 3.6, 180 / np.pi]
    log = read_log(written(tmp_path / "run.csv", header, ",", TABLE * scale))
    np.testing.assert_allclose(log.poses.time, TABLE[:, 0], atol=1e-9)
    np.testing.assert_allclose(log.poses.values, TABLE[:, 1:4], atol=1e-8)
    np.testing.assert_allclose(log.commands.values, TABLE[:, 4:], atol=1e-8)
    assert "theta=yaw [°] [deg]" in log.notes[0]


def test_columns_and_units_that_the_user_names(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", "a,b,c,d,e,f", ",", TABLE * [1, 1, 1, -180 / np.pi, 1, 1])
    with pytest.raises(kl.DataError, match=r"line 1: header: t, x, y, theta missing.*--columns t="):
        kl.Dataset.load(path)
    with pytest.raises(kl.DataError, match="line 1 holds numbers; expected a header before it"):
        kl.Dataset.load(written(tmp_path / "bare.csv", "0,1,2,3,4,5", ",", TABLE))
    names = dict(zip(("t", "x", "y", "theta", "v", "omega"), "abcdef", strict=True))
    data = kl.Dataset.load(path, columns=names, units={"theta": "-deg"})
    np.testing.assert_allclose(data.episodes[0].states[:5], TABLE[:5, 1:4], atol=1e-7)
    with pytest.raises(kl.DataError, match="columns: t=z: no such column; it has a,b,c"):
        kl.Dataset.load(path, columns={**names, "t": "z"})
    with pytest.raises(kl.DataError, match="columns: expected one of t, x"):
        kl.Dataset.load(path, columns={"time": "a"})


def test_commands_that_were_passed_over_are_reported(tmp_path: Path) -> None:
    table = np.column_stack([TABLE, TABLE[:, 4:]])
    header = "t,x,y,theta,v,omega,v_ref,w_ref"
    log = read_log(written(tmp_path / "run.csv", header, ",", table))
    assert "commands may be in v_ref, w_ref, too" in log.notes[0]
    chosen = ReadOptions(columns={"v": "v_ref", "omega": "w_ref"})
    assert read_log(tmp_path / "run.csv", chosen).notes == ("columns: v=v_ref, omega=w_ref",)
    told = read_log(written(tmp_path / "run.csv", header.replace("ref", "cmd"), ",", table))
    assert told.notes == ("columns: v=v_cmd, omega=w_cmd",)


def test_poses_without_commands_need_a_table_of_commands(tmp_path: Path) -> None:
    poses = written(tmp_path / "poses.csv", "t,x,y,theta", ",", TABLE[:, :4])
    with pytest.raises(kl.DataError, match="v, omega missing.*--commands FILE"):
        kl.Dataset.load(poses)
    odometry = "t,x,y,theta,twist.twist.linear.x,/odom/twist/twist/angular/z"
    told = read_log(written(tmp_path / "odom.csv", odometry, ",", TABLE)).notes
    assert "measured speeds stand in for them" in told[-1] and "--commands FILE" in told[-1]
    beside = written(tmp_path / "cmd.csv", "t,v,omega", ",", TABLE[:, [0, 4, 5]])
    assert kl.Dataset.load(poses, commands=beside).steps > 30
    assert not read_log(tmp_path / "odom.csv", ReadOptions(commands=beside)).measured
    early = written(tmp_path / "early.csv", "t,v,omega", ",", TABLE[:, [0, 4, 5]] - [100, 0, 0])
    with pytest.raises(kl.DataError, match="poses from 0 to .* s, commands from -100 to"):
        kl.Dataset.load(poses, commands=early)
    assert kl.Dataset.load(poses, commands=early, shift=100.0).steps > 30
    named = written(tmp_path / "named.csv", "a,b,c", ",", TABLE[:, [0, 4, 5]])
    columns = {"t": "a", "v": "b", "omega": "c"}
    assert kl.Dataset.load(poses, commands=named, columns=columns).steps > 30
    with pytest.raises(kl.DataError, match="theta=d: no such column, nor in"):
        kl.Dataset.load(poses, commands=named, columns={**columns, "theta": "d"})


def test_headings_of_quaternions_of_any_length() -> None:
    theta = np.linspace(-3.0, 3.0, 7)
    for tilt in (0.0, 0.1):
        q = [np.sin(tilt / 2) * np.cos(theta / 2), np.sin(tilt / 2) * np.sin(theta / 2)]
        q += [np.cos(tilt / 2) * np.sin(theta / 2), np.cos(tilt / 2) * np.cos(theta / 2)]
        np.testing.assert_allclose(heading_of(*(2.0 * np.array(q))), theta, atol=1e-9)


def test_a_unit_that_nobody_knows_is_named(tmp_path: Path) -> None:
    path = written(tmp_path / "run.csv", "t,x (furlong),y,theta,v,omega", ",")
    with pytest.raises(kl.DataError, match=r"unknown unit 'furlong' in column 'x \(furlong\)'"):
        read_log(path)
    assert read_log(path, ReadOptions(units={"x": "m"})).units == {"x": "m"}


def test_wheel_speeds_in_turns_need_the_wheels_radius(tmp_path: Path) -> None:
    v, omega = TABLE[:, 4], TABLE[:, 5]
    turns = np.column_stack([v - 0.2 * omega, v + 0.2 * omega]) / 0.1 * 30.0 / np.pi
    table = np.column_stack([TABLE[:, :4], turns])
    path = written(tmp_path / "run.csv", "t,x,y,theta,left (rpm),right (RPM)", ",", table)
    with pytest.raises(kl.DataError, match="left is in rpm, the turns of a wheel: --wheel-radius"):
        read_log(path, ReadOptions(track=0.4))
    log = read_log(path, ReadOptions(track=0.4, wheel_radius=0.1))
    np.testing.assert_allclose(log.commands.values, TABLE[:, 4:], atol=1e-6)
