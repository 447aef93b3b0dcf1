"""Drives by a lidar alone: no obstacle is given to the controller but what the bytes hold."""

import math
import threading

import numpy as np
import pytest
from robots import Clock

import kmpc_lite as kl
from firmware_bridge.integration.course import course, laser_scan
from firmware_bridge.messages import State
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.controller_thread import unicycle_arc
from firmware_bridge.runtime.drive import run
from firmware_bridge.sensors.lidar.ld06 import Ld06
from firmware_bridge.sensors.lidar.options import LidarOptions
from firmware_bridge.sensors.sight import Sight
from kmpc_lab.emulator import lidar as emulated
from kmpc_lab.emulator.lidar import Ld06Emulator, emulated_lidar
from kmpc_lab.emulator.vesc import VescEmulator
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.world import World, world_of

PILLAR = (1.0, 0.05, 0.2)
RADIUS = 0.15


class Wire:
    """A link on which nothing is sent."""

    connected, last_error, counters = True, "", {"reconnects": 0}


def test_a_pillar_on_no_map_is_passed_by_the_bytes_of_a_lidar():
    """Emulated rays, real bytes, decoder, motion undone, controller: all on a clock of the test."""
    clock, where = Clock(), [State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)]
    options = LidarOptions("ld06", "pty:x", mount=(0.05, 0.0, 0.5), no_return="free")
    here = lambda: (where[0].x, where[0].y, where[0].theta)  # noqa: E731
    model = emulated.LidarModel(mount=options.mount)
    lamp = Ld06Emulator(World([(*PILLAR, 0.0, 0.0)]), here, model, 1, clock=clock)
    lidar = Ld06(Wire())
    sight = Sight(options, lidar.sweep)
    problem = kl.NavigationProblem(u_max=(0.6, 2.0), u_min=(-0.6, -2.0))
    controller = kl.Controller(kl.nominal_unicycle(0.1), problem)
    command, closest, saw, ticks = (0.0, 0.0), math.inf, 0, 0
    while math.hypot(where[0].x - 2.0, where[0].y) > 0.05 and ticks < 600:
        if ticks % 10 == 0:
            scan = sight.look(where[0])
            if scan is not None:
                saw += bool(np.isfinite(scan.ranges).any())
                plan = controller.step(here(), (2.0, 0.0, 0.0), [laser_scan(scan)])
                command = tuple(plan.command)
        clock.now += 0.01
        ticks += 1
        where[0] = unicycle_arc(where[0], *command, 0.01)
        where[0] = State(*here(), *command, clock())
        sight.on_tick(clock(), where[0], None, False, False)
        lidar._on_bytes(lamp.advance(), clock())
        gap = math.hypot(where[0].x - PILLAR[0], where[0].y - PILLAR[1]) - PILLAR[2] - RADIUS
        closest = min(closest, gap)
    assert ticks < 600 and saw > 10, "it did not arrive"
    assert 0.0 < closest < 0.5


@pytest.fixture
def robot(tmp_path):
    """A robot with a lidar, both emulated, in four_circles_1; gives what is needed to drive."""
    scenario = Scenario.load("four_circles_1")
    sections = {
        "link": {"url": f"pty:{tmp_path / 'vesc'}", "driver": "vesc"},
        "geometry": {"wheel_radius": 0.0425, "track": 0.27, "max_wheel_speed": 0.9},
        "board": {"can_id": 1, "pole_pairs": 7},
        "limits": {"v_max": 0.5, "omega_max": 2.0},
        # a busy machine makes plans late; what is tried here is the lidar
        "safety": {"socket": str(tmp_path / "estop"), "watchdog": 1.0, "scan_age": 1.0},
        "control": {"scenario": "four_circles_1", "map": False},
        "lidar": {"driver": "ld06", "link": f"pty:{tmp_path / 'lidar'}", "no_return": "free"},
    }
    robot = load_robot(None, sections)
    board = VescEmulator.from_options(robot.driver_table(), slip=0.02, seed=1)
    board.place(*scenario.start)
    lamp = emulated_lidar(robot.lidar, world_of(scenario), lambda: board.pose)
    board.start(robot.link.url)
    lamp.start(robot.lidar.link)
    yield robot, board, lamp, scenario
    lamp.close()
    board.close()


def drive(robot, seconds, also=None):
    """Drive by sight; gives the report, and the navigator."""
    job = course(robot, 0.5, seconds)
    if also is not None:
        threading.Thread(target=also, args=(job.navigator,), daemon=True).start()
    return run(job.robot, job.navigator, job.period, job.origin, None, None)
