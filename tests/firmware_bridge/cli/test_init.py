"""kmpc init: a robot file that can be read, the ports of the machine, and nothing written over."""

import json
from pathlib import Path

import pytest

from firmware_bridge.cli import init
from firmware_bridge.cli.init import Port, serial_ports, templates
from firmware_bridge.link import open_transport
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.session import open_driver
from kmpc_lite.cli.main import main

NAMES = {"rover": "mavlink"}
PLUGGED = Port("/dev/serial/by-id/usb-Board-if00", "/dev/ttyACM0")
HEADER = Port("/dev/ttyAMA0", "/dev/ttyAMA0")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(init, "serial_ports", lambda: [])
    return tmp_path


@pytest.mark.parametrize("name", templates())
def test_a_template_is_written_commented_and_can_be_driven_with(here, capsys, name):
    assert main(["init", name]) == 0
    text = Path("robot.toml").read_text()
    assert text.count("#") > 10 and all(len(line) <= 120 for line in text.splitlines())
    robot = load_robot("robot.toml")
    assert robot.link.driver == NAMES.get(name, name) and robot.gate.geofence is not None
    assert robot.gate.limits.v_max <= 0.3  # slow on purpose
    if name != "rover":
        open_driver(robot, open_transport("pty:link")).close()
    out = capsys.readouterr().out
    assert "wrote  robot.toml" in out and "none found" in out and "kmpc check robot.toml" in out


def test_no_file_is_written_over_but_with_force(here, capsys):
    Path("robot.toml").write_text("mine")
    assert main(["init", "vesc"]) == 2
    assert "robot.toml: is there already" in capsys.readouterr().err
    assert Path("robot.toml").read_text() == "mine"
    assert main(["init", "vesc", "--force"]) == 0
    assert load_robot("robot.toml").link.driver == "vesc"


@pytest.mark.parametrize(
    ("name", "ports", "given", "url"),
    [
        ("roboclaw", [PLUGGED], None, f"serial:{PLUGGED.path}?baud=115200"),
        ("sabertooth", [PLUGGED, HEADER], None, f"serial:{PLUGGED.path}?baud=38400"),
        ("vesc", [HEADER], None, "serial:/dev/ttyAMA0?baud=115200"),
        ("vesc", [PLUGGED], "/dev/ttyS0", "serial:/dev/ttyS0?baud=115200"),
        ("vesc", [PLUGGED], "serial:/dev/ttyS0?baud=9600", "serial:/dev/ttyS0?baud=9600"),
        ("rover", [PLUGGED], "tcp:10.0.0.1:5760", "tcp:10.0.0.1:5760"),
    ],
)
def test_the_link_is_the_given_one_or_the_only_port(
    here, monkeypatch, capsys, name, ports, given, url
):
    monkeypatch.setattr(init, "serial_ports", lambda: ports)
    assert main(["init", name, "--json", *(["--link", given] if given else [])]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["link"] == load_robot("robot.toml").link.url == url
    assert [port["path"] for port in told["ports"]] == [port.path for port in ports]


def test_two_boards_are_listed_and_none_is_guessed(here, monkeypatch, capsys):
    other = Port("/dev/serial/by-id/usb-Other-if00", "/dev/ttyACM1")
    monkeypatch.setattr(init, "serial_ports", lambda: [PLUGGED, other])
    assert main(["init", "odrive"]) == 0
    out = capsys.readouterr().out
    assert PLUGGED.path in out and other.path in out and "(in the file)" not in out


@pytest.mark.parametrize("words", [["--link", "smoke:signals"], ["-o", "no/folder/robot.toml"]])
def test_what_cannot_be_written_is_reported_in_one_line(here, capsys, words):
    assert main(["init", "vesc", *words]) == 2
    assert capsys.readouterr().err.count("\n") == 1 and list(here.iterdir()) == []


def test_ports_are_listed_once_by_their_lasting_name(tmp_path):
    for name in ("ttyACM0", "ttyUSB0", "ttyAMA0", "ttyS0", "null"):
        (tmp_path / name).touch()
    by_id = tmp_path / "serial" / "by-id"
    by_id.mkdir(parents=True)
    (by_id / "usb-Board-if00").symlink_to(tmp_path / "ttyACM0")
    (tmp_path / "serial0").symlink_to(tmp_path / "ttyAMA0")
    found = [
        (Path(p.path).relative_to(tmp_path), Path(p.device).name) for p in serial_ports(tmp_path)
    ]
    assert found == [
        (Path("serial/by-id/usb-Board-if00"), "ttyACM0"),
        (Path("ttyUSB0"), "ttyUSB0"),
        (Path("ttyAMA0"), "ttyAMA0"),
    ]
    assert serial_ports(tmp_path / "none") == []
