"""`kmpc latency`: a row for each driver and rate, of robots that can be built."""

from pathlib import Path

import pytest

from firmware_bridge.link import open_transport
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.session import open_driver
from kmpc_lab.cli.latency_table import MEASURED, robot_text
from kmpc_lite.cli.main import main


@pytest.mark.parametrize("driver", MEASURED)
def test_the_robots_of_the_latency_table_can_be_built(desk, driver):
    Path("robot.toml").write_text(robot_text(driver, desk, 0.02))
    robot = load_robot("robot.toml")
    assert (
        robot.link.driver == driver and robot.control.period == robot.control.command_period == 0.02
    )
    open_driver(robot, open_transport(robot.link.url)).close()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (["--flood", "--drivers", "vesc"], "--drivers: kmpc latency --flood does not read it"),
        (["--flood", "pose", "--rates", "50"], "--rates: kmpc latency --flood does not read it"),
        (
            ["--stops", "2", "--seconds", "3", "--rates", "9"],
            "--seconds, --rates: kmpc latency --stops",
        ),
        (["--flood", "--stops", "2"], "argument --stops: not allowed with argument --flood"),
        (["--busy", "2", "--live-clients", "5"], "--live-clients: not allowed with argument --b"),
    ],
)
def test_what_a_job_does_not_read_is_refused_with_one_line(capsys, given, words):
    try:
        status = main(["latency", *given])
    except SystemExit as ended:
        status = ended.code
    told = capsys.readouterr().err
    assert status == 2 and words in told and told.count("\n") == 1
