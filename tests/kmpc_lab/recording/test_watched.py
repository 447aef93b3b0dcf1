"""Simulated drives in real time, and their STOP."""

from dataclasses import replace

import numpy as np
import pytest
from robots import Clock

import kmpc_lite as kl
from firmware_bridge.live.moment import map_packet
from firmware_bridge.live.picture import Picture
from kmpc_lab import Outcome, drive
from kmpc_lab.recording.simulated import WatchedController
from kmpc_lite.scenario.files import Scenario


def watched(scenario: Scenario):
    clock = Clock()
    controller = kl.Controller(kl.nominal_unicycle(0.1), scenario.problem(kl.NavigationProblem()))
    return WatchedController(controller, clock, clock.sleep), clock


def test_it_drives_as_without_a_page_at_the_pace_of_the_clock():
    scenario = Scenario.load("four_circles_1")
    seen, clock = watched(scenario)
    plain, _ = watched(scenario)
    run, same = drive(seen, scenario), drive(plain._controller, scenario)
    assert run.outcome is Outcome.REACHED and np.array_equal(run.inputs, same.inputs)
    assert sum(clock.slept) == pytest.approx(run.duration)
    shown = Picture()
    shown.take({**map_packet(scenario, "a"), **seen.packet()})
    values = shown.values
    assert values["gate"] == "ACTIVE" and values["distance"] < 0.5 and values["step"]["p50"] > 0.0
    assert len(values["plan"]) == 21 * 3 * 8 and len(values["circles"]) == 4 * 5 * 8


def test_stop_brakes_the_simulated_robot_and_holds_it_until_it_may_drive_again():
    scenario = Scenario.load("four_circles_1")
    seen, _ = watched(scenario)
    x = np.array(scenario.start)
    model, goal = kl.nominal_unicycle(0.1), scenario.goal

    def go(steps: int) -> list[np.ndarray]:
        nonlocal x
        commands = []
        for _ in range(steps):
            command = seen.step(x, goal, scenario.obstacles_at(0.0)).command
            x = model.predict(x, command)
            commands.append(command)
        return commands

    fast = go(15)[-1]
    assert abs(fast[0]) > 0.2
    seen.hear("stop")
    slowing = go(12)
    fall = seen._controller.problem.deceleration * 0.1 + 1e-9
    assert (np.abs(np.diff([fast, *slowing], axis=0)) <= fall).all()
    assert not slowing[-1].any() and seen.packet()["gate"] == "ESTOP" and seen.packet()["latched"]
    seen.hear("enable")  # refused while the stop is pressed
    seen.hear("reset")
    assert not go(3)[-1].any() and seen.packet()["gate"] == "IDLE"
    seen.hear("enable")
    assert abs(go(10)[-1][0]) > 0.1 and seen.packet()["gate"] == "ACTIVE"


def test_large_grids_and_many_circles_are_shown_in_part():
    cells = np.zeros((700, 300))
    cells[5, 5] = 100
    grid = kl.OccupancyGrid(cells, 0.01, (-2.0, -3.0, 0.1))
    cart, table = kl.Footprint.rectangle(0.4, 0.2), Scenario.load("four_circles_1")
    scenario = replace(table, grid=grid, circles=(), walls=(kl.Wall(0, 1, 1, 1, 0.1),))
    packet = map_packet(replace(scenario, footprint=cart), "a")
    assert map_packet(scenario, "a")["outline"] is None
    np.testing.assert_array_equal(np.frombuffer(packet["outline"]).reshape(4, 2), cart.outline)
    shown = packet["grid"]
    assert shown["height"] <= 256 and shown["resolution"] == pytest.approx(0.03)
    assert shown["height"] * 3 >= 700
    walls = np.frombuffer(packet["walls"][0]).reshape(4, 2)
    assert walls.min(axis=0).tolist() == [0.0, 0.95] and walls.max(axis=0).tolist() == [1.0, 1.05]
