"""`kmpc ros2` refuses what is wrong on its command line in one line."""

import pytest
from ros2_drive import HERE, NO_ROS

from kmpc_lite.cli.main import main

WRONG = {
    "--goal nan 0 0": "expected a number",
    "--model nothere.npz": "cannot read the model",
    "nothere.toml": "cannot read the robot file",
    "--timeout 0.1": "no odometry on /odom after 0.1 s",
    "--ros-args -p scan:=front": "parameter scan: unknown",
    "--ros-args -p limits.v_max:=fast": "limits.v_max: expected float",
    "--ros-args -r a:b:=c:=d": "--ros-args: ",
}


@pytest.mark.parametrize(("line", "told"), WRONG.items())
def test_what_is_wrong_is_reported_in_one_line(line, told, capsys, tmp_path, monkeypatch) -> None:
    pytest.importorskip("rclpy", reason=NO_ROS)
    for name, value in HERE.items():
        monkeypatch.setenv(name, value)
    words = ["ros2", "--socket", str(tmp_path / "estop"), "--timeout", "0.1", *line.split()]
    assert main(words) == 2
    error = capsys.readouterr().err.strip()
    assert told in error.splitlines()[-1] and "Traceback" not in error


@pytest.mark.parametrize("command", ["ros2", "emulate ros2"])
def test_without_rclpy_it_says_what_to_install(command: str, capsys, monkeypatch) -> None:
    monkeypatch.setattr("kmpc_lite.cli.command.is_installed", lambda module: module != "rclpy")
    assert main(command.split()) == 2
    error = capsys.readouterr().err
    assert "/opt/ros/" in error and "pip install 'kmpc-lite[ros2-test]'" in error


def test_a_lidar_of_its_own_is_refused_where_topics_report_of_scans(capsys, tmp_path, monkeypatch):
    pytest.importorskip("rclpy", reason=NO_ROS)
    for name, value in HERE.items():
        monkeypatch.setenv(name, value)
    file = tmp_path / "robot.toml"
    file.write_text('[lidar]\ndriver = "ld06"\nlink = "pty:lidar"\n')
    assert main(["ros2", str(file)]) == 2
    assert "kmpc ros2 sees by the topics" in capsys.readouterr().err


def test_a_robot_file_of_topics_is_driven_by_kmpc_ros2_alone(capsys, tmp_path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text('[link]\nurl = "tcp:127.0.0.1:1"\ndriver = "ros2"\n')
    assert main(["run", str(file), "--scenario", "mehrez"]) == 2
    assert "driven by kmpc ros2" in capsys.readouterr().err
