"""`kmpc ros2` refuses what is wrong on its command line in one line, before anything is opened."""

import pytest

from kmpc_lite.cli import extras
from kmpc_lite.cli.main import main

WRONG = {
    "--domain 999": "domain: expected 0 to 232",
    "--topic foo=/x": "expected ROLE=NAME with a role of odom",
    "--topic odom=": "cannot be left out",
    "--topic odom=/a --topic odom=/b": "at most 1",
    "--topic scan=1/2": "expected a ROS name",
    "--connect 127.0.0.1:7447": "expected a zenoh endpoint",
    "--distro noetic": "expected jazzy, kilted, humble",
    "--namespace a//b": "expected a ROS name",
    "--goal nan 0 0": "expected a number",
    "--scan-mount 0 0 inf": "expected a number",
    "--scan-age 0": "scan_age",
    "--model nothere.npz": "cannot read the model",
    "--emulate nothere": "no scenario named",
    "--emulate mehrez --connect tcp/localhost:1": "no --connect",
    "nothere.toml": "cannot read the robot file",
    "--connect tcp/127.0.0.1:1 --timeout 0.1": "no Zenoh router",
}


@pytest.mark.parametrize(("line", "told"), WRONG.items())
def test_what_is_wrong_is_reported_in_one_line(
    line: str, told: str, capsys: pytest.CaptureFixture[str], tmp_path
) -> None:
    pytest.importorskip("zenoh", reason="the extra ros2 (eclipse-zenoh) is not installed")
    words = ["ros2", *line.split(), "--socket", str(tmp_path / "estop")]
    assert main(words) == 2
    error = capsys.readouterr().err.strip()
    # the last line: notes on a model may stand above it
    assert told in error.splitlines()[-1] and "Traceback" not in error


@pytest.mark.parametrize("command", ["ros2", "emulate ros2"])
def test_without_the_extra_it_says_what_to_install(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extras, "is_installed", lambda module: module != "zenoh")
    assert main(command.split()) == 2
    assert "pip install 'kmpc-lite[ros2]'" in capsys.readouterr().err


def test_a_lidar_of_its_own_is_refused_where_topics_report_of_scans(
    capsys: pytest.CaptureFixture[str], tmp_path
) -> None:
    pytest.importorskip("zenoh", reason="the extra ros2 (eclipse-zenoh) is not installed")
    file = tmp_path / "robot.toml"
    file.write_text('[lidar]\ndriver = "ld06"\nlink = "pty:lidar"\n')
    assert main(["ros2", str(file), "--emulate", "mehrez"]) == 2
    assert "kmpc ros2 sees by topics" in capsys.readouterr().err


def test_a_robot_file_of_topics_is_driven_by_kmpc_ros2_alone(
    capsys: pytest.CaptureFixture[str], tmp_path
) -> None:
    file = tmp_path / "robot.toml"
    file.write_text('[link]\nurl = "tcp:127.0.0.1:1"\ndriver = "ros2"\n')
    assert main(["run", str(file), "--scenario", "mehrez"]) == 2
    assert "driven by kmpc ros2" in capsys.readouterr().err
