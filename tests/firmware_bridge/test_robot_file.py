"""Robot files: what they hold, and the one line that tells what is wrong."""

from __future__ import annotations

import textwrap
from pathlib import Path

import pytest

from firmware_bridge.integration.course import course
from firmware_bridge.link import open_transport
from firmware_bridge.messages import ConfigError
from firmware_bridge.robot_checks import check_period
from firmware_bridge.robot_file import SECTIONS, ControlOptions, LinkOptions, load_robot
from firmware_bridge.runtime.session import open_driver
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import diagram, legend
from kmpc_lite import Footprint

ROBOTS = Path(__file__).parents[2] / "docs" / "robots"
LINK = '[link]\nurl = "tcp:127.0.0.1:1"\ndriver = "mavlink"\n'


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(textwrap.dedent(text))
    return path


@pytest.mark.parametrize("path", sorted(ROBOTS.glob("*.toml")), ids=lambda p: p.stem)
def test_the_files_of_the_docs_are_valid_and_their_drivers_can_be_built(path):
    robot = load_robot(path)
    assert robot.link.url.startswith("serial:") and robot.gate.geofence is not None
    open_driver(robot, open_transport(robot.link.url)).close()


def test_everything_of_a_file_arrives(tmp_path):
    robot = load_robot(
        write(
            tmp_path,
            """
            [link]
            url = "pty:robot"
            driver = "roboclaw"
            timeout = 3
            [geometry]
            wheel_radius = 0.05
            [limits]
            v_max = 0.5
            deceleration = 2.0
            [safety]
            watchdog = 0.2
            hold = 0.7
            geofence = [-1, -2, 3, 4]
            socket = "/run/robot.sock"
            [frame]
            origin = [1, 2, 0.5]
            [control]
            period = 0.05
            latency = 0.1
            model = "m.npz"
            """,
        )
    )
    assert (robot.link.timeout, robot.gate.limits.v_max, robot.gate.limits.deceleration) == (
        3.0,
        0.5,
        2.0,
    )
    assert (robot.gate.watchdog, robot.gate.hold, robot.gate.geofence) == (0.2, 0.7, (-1, -2, 3, 4))
    assert (robot.origin, str(robot.socket), robot.control.period) == (
        (1.0, 2.0, 0.5),
        "/run/robot.sock",
        0.05,
    )
    assert (
        not robot.gate.pilot
        and not robot.is_autopilot
        and robot.driver_table()["geometry"] == {"wheel_radius": 0.05}
    )


def test_the_command_line_lies_over_the_file_and_may_do_without_it(tmp_path):
    path = write(tmp_path, LINK + "[limits]\nv_max = 0.5\n")
    robot = load_robot(
        path,
        {
            "limits": {"v_max": 0.1, "omega_max": None},
            "link": {"url": "udp:127.0.0.1:2"},
            "control": {"model": "a.npz"},
        },
    )
    assert (robot.gate.limits.v_max, robot.link.url, robot.control.model) == (
        0.1,
        "udp:127.0.0.1:2",
        "a.npz",
    )
    alone = load_robot(None, {"link": {"url": "tcp::1", "driver": "mavlink"}})
    assert alone.where == "command line" and alone.link.driver == "mavlink"


def test_a_footprint_takes_the_place_of_the_scenarios_robot(tmp_path):
    text = (
        LINK + '[robot]\nfootprint = {length = 0.5, width = 0.3}\n[control]\nscenario = "mehrez"\n'
    )
    robot = load_robot(write(tmp_path, text))
    made = course(robot, settle=0.5, seconds=10.0)
    assert made.controller.problem.footprint == Footprint.rectangle(0.5, 0.3)
    assert made.scenario.footprint == made.controller.problem.footprint
    wrong = load_robot(write(tmp_path, text.replace("0.3}", "-0.3}")))
    with pytest.raises(ConfigError, match="footprint: width: expected a number > 0"):
        course(wrong, settle=0.5, seconds=10.0)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            '[link]\nurl = "tcp::1"\ndriver = "servo"',
            "link.driver: expected mavlink, roboclaw, odrive, vesc, roboteq, sabertooth, arduino, "
            "onboard, got",
        ),
        (LINK + "timeout = 0", "link.timeout: expected 0.1 to 300 s, got 0"),
        (LINK + "[wheels]\nradius = 1", r"unknown section \[wheels\]; expected \[link\]"),
        ("link = 3", r"\[link\] must be a section, got 3"),
        (LINK + "[safety]\nwatchdog = 0", "safety.watchdog: expected 0.01 to 60 s, got 0"),
        (
            LINK + "[safety]\nwatchdogs = 1",
            "safety.watchdogs: unknown key; .safety. takes watchdog, pose_age",
        ),
        (LINK + "[safety]\ngeofence = 3", "safety.geofence: expected .xmin, ymin, xmax, ymax."),
        (LINK + "[safety]\nsocket = 3", "safety.socket: expected a path, got 3"),
        (LINK + "[frame]\norigin = [0, 0]", "frame.origin: expected .x, y, theta."),
        (LINK + "[frame]\nstart = [0, 0, 0]", "frame.start: unknown key"),
        (LINK + "[control]\nperiod = 0", "control.period: expected 0.01 to 1 s, got 0"),
        (
            LINK + "[limits]\nv_max = 20\n[geometry]\nmax_wheel_speed = 0.9",
            "limits.v_max: 20 m/s is more than geometry.max_wheel_speed, 0.9 m/s",
        ),
    ],
)
def test_whatever_is_wrong_is_reported_with_file_and_key_in_one_line(tmp_path, text, words):
    path = tmp_path / "robot.toml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ConfigError, match=words) as caught:
        load_robot(path)
    assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LINK + "[board]\nsystem = 0", "board.system: expected a MAVLink id"),
        (LINK + "[geometry]\ntrack = 1", "an autopilot has its own"),
        ('[link]\nurl = "tcp::1"\ndriver = "roboclaw"', "geometry.wheel_radius: missing"),
        (
            '[link]\nurl = "tcp::1"\ndriver = "vesc"\n[geometry]\nwheel_radius = 0',
            "geometry.max_wheel_speed: missing",
        ),
    ],
)
def test_what_the_driver_finds_wrong_is_reported_with_the_file_too(tmp_path, text, words):
    path = tmp_path / "robot.toml"
    path.write_text(text)
    robot = load_robot(path)
    with pytest.raises(ConfigError, match=words) as caught:
        open_driver(robot, open_transport(robot.link.url))
    assert str(caught.value).startswith(f"{path}: ")


def test_a_period_must_leave_room_for_one_late_plan():
    check_period(0.16, GateSettings())
    with pytest.raises(ConfigError, match="control.period"):
        check_period(0.17, GateSettings())
    check_period(1.0, GateSettings(watchdog=1.5))


DOCS = Path(__file__).parents[2] / "docs"
BRIDGE = (DOCS / "howto" / "bridge.md").read_text()


def test_the_state_machine_in_the_docs_is_the_one_in_the_code():
    assert f"```mermaid\n{diagram()}\n```" in BRIDGE
    assert legend() in BRIDGE


def test_every_section_and_key_of_a_robot_file_is_named():
    assert all(f"`[{section}]`" in BRIDGE for section in SECTIONS)
    for options in (LinkOptions, ControlOptions):
        assert all(f"`{name}`" in BRIDGE for name in options.__dataclass_fields__)
    assert all(f"`{name}`" in BRIDGE for name in GateSettings().limits.__dataclass_fields__)
    assert all(
        f"`{name}`" in BRIDGE
        for name in GateSettings.__dataclass_fields__
        if name not in ("limits", "pilot")
    )
