"""`kmpc signing`: keys as ground stations make them, given to a vehicle that is disarmed."""

import hashlib
import io
import json
import sys

import pytest
from courses import PATIENT
from waiting import until

from firmware_bridge.drivers.mavlink.signing import others_may_listen
from firmware_bridge.robot_file import load_robot
from kmpc_lab.emulator.build import build_emulator
from kmpc_lite.cli.main import main

LINK = "pty:link"
ROBOT = ["--driver", "mavlink", "--link", LINK, *PATIENT]


@pytest.fixture
def rover(desk):
    robot = load_robot(None, {"link": {"url": LINK, "driver": "mavlink"}})
    rover = build_emulator(robot, (0.0, 0.0, 0.0), 0.0, 1.0, 0, 0.1)
    rover.start(LINK)
    yield rover
    rover.close()


def make_key(name="signing.key"):
    assert main(["signing", "key", name, "--json"]) == 0


def test_a_key_of_a_passphrase_is_that_of_the_ground_stations(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdin", io.StringIO("correct horse\n"))
    assert main(["signing", "key", "a.key", "--passphrase"]) == 0
    text = (tmp_path / "a.key").read_text().strip()
    assert bytes.fromhex(text) == hashlib.sha256(b"correct horse").digest()
    assert (tmp_path / "a.key").stat().st_mode & 0o777 == 0o600
    assert main(["signing", "key", "a.key"]) == 2
    assert "never overwritten" in capsys.readouterr().err
    make_key("b.key")
    make_key("c.key")
    assert (tmp_path / "b.key").read_text() != (tmp_path / "c.key").read_text()


def test_the_vehicle_takes_the_key_and_check_names_what_is_missing(rover, capsys, monkeypatch):
    monkeypatch.setattr("firmware_bridge.cli.check.PREARM", 0.1)  # nothing is kept from arming here
    make_key()
    assert main(["signing", "setup", *ROBOT, "--key", "signing.key", "--yes", "--json"]) == 0
    assert json.loads(capsys.readouterr().out.splitlines()[-1]) == {"ok": True}
    short = ["--timeout", "2", "--seconds", "0.3"]
    assert main(["check", *ROBOT, *short]) == 1
    assert "it signs its frames, and refuses ours" in capsys.readouterr().out
    key = ["--set", 'board.key_file="signing.key"']
    assert main(["check", *ROBOT, *short, *key]) == 0
    make_key("other.key")
    change = ["signing", "setup", *ROBOT, "--key", "other.key", "--yes"]
    assert main([*change, "--timeout", "2"]) == 2, "it does not take a key from who has none"
    assert "has it another one?" in capsys.readouterr().err
    assert main([*change, *key]) == 0


def test_nothing_is_sent_unasked_armed_or_over_a_network(rover, capsys):
    make_key()
    setup = ["signing", "setup", "--driver", "mavlink", "--key", "signing.key"]
    assert main([*setup, "--link", LINK]) == 2
    assert "not confirmed" in capsys.readouterr().err
    assert main([*setup, "--link", "udp:192.168.7.7:14550", "--yes"]) == 2
    assert "the key would travel unencrypted" in capsys.readouterr().err
    assert rover._codec._mav.signing.secret_key is None
    assert until(rover.pilot_arm)  # once it has its position
    assert main([*setup, "--link", LINK, "--yes"]) == 2
    assert "while disarmed only" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("url", "shared"),
    [
        ("serial:/dev/ttyACM0", False),
        ("pty:link", False),
        ("tcp:localhost:5760", False),
        ("udp:127.0.0.1:14550?listen=1", False),
        ("tcp:10.0.0.2:5760", True),
        ("udp:rover.local:14550", True),
        ("udp:0.0.0.0:14550?listen=1", True),
    ],
)
def test_which_links_others_may_listen_to(url, shared):
    assert others_may_listen(url) is shared
