"""A drive by topics, recorded as any other is."""

from types import SimpleNamespace

import numpy as np
import pytest

import kmpc_lite as kl
from firmware_bridge.cli.ros2_recording import Driven, LateEncoder, topic_recorder
from firmware_bridge.recording.drive.records import PoseSeen
from firmware_bridge.robot_file import load_robot
from firmware_bridge.ros2.inputs import Goal
from firmware_bridge.runtime.navigator import figures
from kmpc_lab.recording.drive_file import load_drive
from kmpc_lab.sim.closed_loop import Outcome


def record(tmp_path, goal, reached=1):
    controller = kl.Controller(kl.nominal_unicycle(0.1), kl.NavigationProblem())
    cells = np.zeros((40, 40), np.int8)
    cells[30:34, 30:34] = 100
    seen = [
        kl.OccupancyGrid(cells, 0.1, (-1.0, -2.0, 0.0)),
        kl.LaserScan(np.full(90, 2.0), 0.0, 0.07, 4.0),
    ]
    navigator = SimpleNamespace(obstacles=[], goal=goal)
    job = Driven(controller, navigator, [])
    robot = load_robot(None, {"link": {"url": "zenoh", "driver": "ros2"}})
    session = SimpleNamespace(robot=robot, loop=SimpleNamespace(snapshot=None))
    clearance = np.inf
    recorder = topic_recorder(job, 0.1, "kmpc ros2")(session, tmp_path / "drive")
    pose = np.zeros(3)
    for _ in range(5):
        plan = controller.step(pose, goal, seen)
        navigator.obstacles = seen
        for saw in job.watchers:
            saw(tuple(pose.tolist()), plan)
        recorder.planned()
        clearance = min(clearance, float(plan.around.clearance(pose[None])))
        pose = plan.states[1]
    after, loop = 0.5 if reached else None, {"commands_sent": 5, "commands_refused": 0}
    told = figures(0.5, after, (0.01, 0.02), clearance)
    recorder.finish({**told, "ended": "", "loop": loop})
    recorder.close()
    return load_drive(tmp_path / "drive.mcap")


def test_map_scans_goal_and_outcome_are_in_it(tmp_path):
    run = record(tmp_path, Goal(1.0, 0.5, 0.0))
    assert run.scenario.goal == (1.0, 0.5, 0.0) and run.scenario.start == (0.0, 0.0, 0.0)
    assert run.scenario.grid is not None and run.outcome is Outcome.REACHED
    assert 0.0 < run.clearance < 2.0
    assert len(run.details.scans) == len(run.details.times) == 5
    assert run.details.scans[0][1].range_max == pytest.approx(4.0)


def test_a_goal_where_the_map_has_something_is_kept_without_the_map(tmp_path):
    run = record(tmp_path, Goal(2.15, 1.15, 0.0), reached=0)
    assert run.scenario.grid is None and run.outcome is Outcome.TIMEOUT


def test_nothing_is_encoded_before_the_first_plan():
    encode = LateEncoder(lambda first: pytest.fail("there is none"))
    assert encode([PoseSeen(1.0, (0.0, 0.0, 0.0))]) == []
