"""The node for rclpy in examples/ros2, on a stub of rclpy with the real message definitions."""

import ast
import math
import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.lidar import scan_ranges
from kmpc_lite.scenario.lidar import LidarSpec
from kmpc_lite.scenario.world import World

pytest.importorskip("rosbags")
from rclpy_stub import Network

FOLDER = Path(__file__).parents[3] / "examples" / "ros2"
CIRCLE = (0.7, 0.4, 0.2)
RADIUS = 0.2


class Robot:
    """The node, and a robot that obeys it at once and sees one circle."""

    wheelbase = 0.0
    """Of a car that is steered by AckermannDriveStamped [m]."""

    def __init__(self, network: Network) -> None:
        self.network, self.pose = network, np.zeros(3)
        self.world, self.lidar = World(np.array([(*CIRCLE, 0.0, 0.0)]), []), LidarSpec(4.0)
        self.random, self.model = np.random.default_rng(1), kl.nominal_omni(0.1)
        self.nearest = math.inf

    def sense(self, age: float = 0.0) -> None:
        odometry = self.network.stamped("odom", "odom", age)
        at = odometry.pose.pose
        at.position.x, at.position.y = float(self.pose[0]), float(self.pose[1])
        at.orientation.z = math.sin(self.pose[2] / 2)
        at.orientation.w = math.cos(self.pose[2] / 2)
        self.network.send("odom", odometry)
        scan = self.network.stamped("scan", "laser", age)
        ranges, _ = scan_ranges(self.world, self.lidar, self.pose, self.random)
        scan.ranges = ranges.astype(np.float32)
        scan.angle_min, scan.angle_increment = -math.pi, 2.0 * math.pi / self.lidar.beams
        scan.range_max, scan.range_min = self.lidar.reach, self.lidar.nearest
        self.network.send("scan", scan)

    def turn_timer(self) -> np.ndarray[Any, Any]:
        period, step = self.network.timer
        step()
        topic, message = self.network.published[-1]
        if self.wheelbase:
            v, angle = message.drive.speed, message.drive.steering_angle
            command = np.array([v, 0.0, v * math.tan(angle) / self.wheelbase])
        else:
            command = np.array([message.linear.x, message.linear.y, message.angular.z])
        self.pose = self.model.predict(self.pose, command)
        self.network.now += period
        away = math.dist(self.pose[:2], CIRCLE[:2]) - CIRCLE[2] - RADIUS
        self.nearest = min(self.nearest, away)
        assert topic == "cmd_vel"
        return command


def started(
    monkeypatch: pytest.MonkeyPatch, distribution: str = "jazzy", **parameters: Any
) -> Robot:
    network = Network(distribution, {"radius": RADIUS, "v_max": 0.5, **parameters})
    network.install(monkeypatch)
    runpy.run_path(str(FOLDER / "kmpc_node.py"))["KmpcNode"]()
    network.now = 100.0
    return Robot(network)


def send_goal(robot: Robot, frame: str = "odom") -> None:
    goal = robot.network.stamped("goal_pose", frame)
    goal.pose.position.x, goal.pose.position.y, goal.pose.orientation.w = 1.5, 0.8, 1.0
    robot.network.send("goal_pose", goal)


@pytest.mark.parametrize("distribution", ["jazzy", "humble"])
def test_it_drives_to_a_goal_past_what_its_scan_shows(
    distribution: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = started(monkeypatch, distribution)
    send_goal(robot)
    for _ in range(150):
        robot.sense()
        command = robot.turn_timer()
    assert math.dist(robot.pose[:2], (1.5, 0.8)) < 0.05 and not command.any()
    assert robot.nearest > 0.0


def test_a_car_is_steered_within_its_turning_radius(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = started(monkeypatch, turning_radius=0.5, wheelbase=0.3)
    robot.wheelbase = 0.3
    send_goal(robot)
    for _ in range(250):
        robot.sense()
        v, _, omega = robot.turn_timer()
        assert abs(omega) <= abs(v) / 0.5 + 1e-6
    assert math.dist(robot.pose[:2], (1.5, 0.8)) < 0.05 and robot.nearest > 0.0


def test_it_brakes_when_messages_stop(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = started(monkeypatch)
    send_goal(robot)
    for _ in range(20):
        robot.sense()
        command = robot.turn_timer()
    assert command[0] > 0.2
    speeds = [abs(robot.turn_timer()[0]) for _ in range(15)]
    assert speeds[-1] == 0.0 and robot.nearest > 0.0


def test_the_launch_file_sets_parameters_that_the_node_declares() -> None:
    launch = ast.parse((FOLDER / "kmpc.launch.py").read_text())
    (defaults,) = (
        ast.literal_eval(line.value)
        for line in launch.body
        if isinstance(line, ast.Assign) and ast.unparse(line.targets[0]) == "DEFAULTS"
    )
    node = ast.parse((FOLDER / "kmpc_node.py").read_text())
    asked = {
        call.args[0].value
        for call in ast.walk(node)
        if isinstance(call, ast.Call) and ast.unparse(call.func) == "self.ask"
        if isinstance(call.args[0], ast.Constant)
    }
    assert set(defaults) <= asked
