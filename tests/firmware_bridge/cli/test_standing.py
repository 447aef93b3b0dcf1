"""A robot whose pose lies inside an obstacle of its scenario is not driven, and says why."""

import json
import math

import pytest
from courses import PATIENT
from emulated_robots import emulated, robot_options
from waiting import until

from firmware_bridge.integration.course import misplaced
from kmpc_lite.cli.main import main
from kmpc_lite.scenario.files import Scenario

WORDS = "m from the scenario's start: is frame.origin right?"


@pytest.mark.parametrize(("depth", "refused"), [(-0.1, False), (0.07, False), (0.08, True)])
def test_half_its_radius_inside_cannot_be_true(depth, refused, desk):
    scenario = Scenario.load("course.toml")
    x, y, radius = 0.4, 0.45, 0.1 + scenario.radius
    told = misplaced(scenario, (x - radius + depth, y, 0.0))
    assert bool(told) == refused
    assert misplaced(scenario, (math.nan, 0.0, 0.0)) == ""
    if refused:
        assert told.startswith("stands inside an obstacle by 0.08 m") and told.endswith(WORDS)


def test_run_and_check_refuse_a_robot_in_a_wall(desk, capsys):
    with emulated("rover") as rover:
        command = [*robot_options("rover"), "--scenario", "walls_door", "--json"]
        assert main(["run", *command, "--seconds", "20"]) == 1
        report = json.loads(capsys.readouterr().out)
        assert report["outcome"].startswith("not driven: stands inside an obstacle by 0.1")
        assert report["outcome"].endswith(f"1.80 {WORDS}")
        assert report["arrived_after_s"] is None and rover.pose == (0.0, 0.0, 0.0)
        options = [*command[:3], *PATIENT, *command[-3:]]

        def refused():
            assert main(["check", *options, "--seconds", "2"]) == 1
            found = json.loads(capsys.readouterr().out)["findings"]
            return [f for f in found if f["text"].endswith(f"1.80 {WORDS}") and not f["ok"]]

        assert until(refused)
        options += ["--set", "frame.origin=[-1.5, -1.0, 0.0]"]
        main(["check", *options, "--seconds", "2"])
        assert WORDS not in capsys.readouterr().out
