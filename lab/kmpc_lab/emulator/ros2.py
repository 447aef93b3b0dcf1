"""A robot among a scenario's obstacles whose only link are ROS 2 topics: a node of rclpy.

Its sensors see a map of cells, and ranges of beams.
"""

from __future__ import annotations

import math
import os
import threading
import time
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import rclpy
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseWithCovarianceStamped, Twist, TwistStamped
from nav_msgs.msg import OccupancyGrid, Odometry
from numpy.typing import NDArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header

from firmware_bridge.ros2.geometry import Place
from kmpc_lab.sim.plants.plant import scenario_plant
from kmpc_lite.geometry import rotate
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.world import obstacle_gaps, point_gaps
from kmpc_lite.types import Array

BORDER = 0.5  # the map reaches so far beyond the scenario's area [m]
CLOSE = 0.002  # a beam ends where an obstacle is nearer than this [m]
STEPS = 80  # steps by which a beam is followed; one that grazes an obstacle takes many
OCCUPIED, FREE = 100, 0
STEP = 0.02  # of the physics, and between two odometry messages [s]
MOTOR_LAG = 0.05
BEAMS, FARTHEST, SCAN_EVERY = 360, 8.0, 5
"""Of the scanner at the robot's centre; how far it sees [m]; steps between two scans."""
LOCALISED_EVERY = 50  # steps between two messages of the localisation
WATCHDOG = 0.5  # it stops when it hears no command for so long [s]
BEHIND = 1.0  # a simulator that is farther behind does not catch up [s]
SENSOR = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class CellMap(NamedTuple):
    """A map as nav_msgs/OccupancyGrid has it."""

    cells: NDArray[np.int8]  # (height, width), the lowest row first
    resolution: float  # [m]
    origin: tuple[float, float]  # of the first cell's corner [m]


class World:
    """A scenario's obstacles.

    `scenario`: its circles and solids stand where they are at the beginning.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario

    def distances(self, points: Array) -> Array:
        """Distances (n,) of points (n, 2) from the nearest edge [m]; negative inside."""
        return point_gaps(self._scenario, points, np.zeros(len(points)))

    def cells(self, resolution: float = 0.05) -> CellMap:
        """Cells that an obstacle touches, of a side [m]."""
        x_min, y_min, x_max, y_max = self._scenario.bounds
        low = np.array((x_min, y_min)) - BORDER
        width, height = np.ceil((np.array((x_max, y_max)) + BORDER - low) / resolution).astype(int)
        x = low[0] + resolution * (np.arange(width) + 0.5)
        y = low[1] + resolution * (np.arange(height) + 0.5)
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        near = self.distances(points) < resolution * np.sqrt(0.5)
        cells = np.where(near, OCCUPIED, FREE).astype(np.int8).reshape(height, width)
        return CellMap(cells, resolution, (float(low[0]), float(low[1])))

    def ranges(self, eye: Array, angles: Array, farthest: float) -> Array:
        """How far beams at angles (B,) [rad] from an eye (2,) [m] reach; infinite past `farthest`.

        A beam goes on by the distance to the nearest edge, over which it cannot jump.
        """
        along = np.stack([np.cos(angles), np.sin(angles)], axis=1)
        reach = np.zeros(len(angles))
        for _ in range(STEPS):
            gap = np.minimum(self.distances(eye + reach[:, None] * along), farthest)
            moving = (gap > CLOSE) & (reach < farthest)
            if not moving.any():
                break
            reach = np.where(moving, reach + gap, reach)
        return np.where(reach < farthest, reach, np.inf)


@dataclass(frozen=True)
class EmulatedRobot:
    """Which sensors it has, and how it is commanded."""

    sees: tuple[str, ...] = ("map", "scan")  # which topics tell of obstacles
    stamped: bool = False  # whether it listens to TwistStamped
    drifts: bool = False
    """Whether odometry begins at zero, in `odom`, and `amcl_pose` tells where that is; else it is
    that of the map."""
    simulated_time: bool = False  # whether stamps count from the start, and /clock is published


class Ros2Emulator:
    """Publishes odometry, scan and map, and obeys cmd_vel, on the scenario's wheels.

    `scenario`: start, floor and obstacles. `robot`: what it has. `seed`: of the slip. `arguments`:
    of ROS: ``-r __ns:=/robot``.
    """

    def __init__(
        self,
        scenario: Scenario,
        robot: EmulatedRobot | None = None,
        seed: int = 0,
        arguments: tuple[str, ...] = (),
    ) -> None:
        self._scenario, self._arguments = scenario, arguments
        self._robot = EmulatedRobot() if robot is None else robot
        self._world = World(scenario)
        # which lags only on wheels on either side
        driven = replace(scenario, seed=seed, lag=scenario.lag or MOTOR_LAG)
        self._plant = scenario_plant(driven)
        self._pose = np.array(scenario.start, dtype=float)
        self._still = np.zeros(scenario.problem().wheels.inputs)
        self._command, self._heard = self._still, -math.inf
        self.commands = 0  # number of commands that came
        self.clearance = math.inf
        """Least distance between the edges of the robot and the nearest obstacle so far [m]."""
        self.silent: set[str] = set()  # topics that are not published for now
        self._steps = 0
        self._quit = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, url: str = "") -> None:
        """Appear on the network: of this machine alone, unless the environment says otherwise."""
        os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
        self._context = rclpy.Context()
        rclpy.init(args=["--ros-args", *self._arguments], context=self._context)
        self._node = node = rclpy.create_node("emulated_robot", context=self._context)
        topics: list[tuple[str, type, Any]] = [("odom", Odometry, 10)]
        seen = {"scan": (LaserScan, SENSOR), "map": (OccupancyGrid, LATCHED)}
        topics += [(name, *seen[name]) for name in self._robot.sees]
        topics += [("amcl_pose", PoseWithCovarianceStamped, LATCHED)] * self._robot.drifts
        topics += [("/clock", Clock, SENSOR)] * self._robot.simulated_time
        self._publishers: dict[str, Any] = {
            name: node.create_publisher(kind, name, qos) for name, kind, qos in topics
        }
        kind = TwistStamped if self._robot.stamped else Twist
        node.create_subscription(kind, "cmd_vel", self._take, 1)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(node)
        self._began = time.monotonic() - self._steps * STEP
        if "map" in self._robot.sees:
            self._publishers["map"].publish(self._map())
        self._thread = threading.Thread(target=self._run, name="ros2-robot", daemon=True)
        self._thread.start()

    @property
    def pose(self) -> tuple[float, float, float]:
        """True x, y [m], theta [rad] in the map."""
        x, y, theta = self._pose.tolist()
        return x, y, theta

    def put(self, x: float, y: float, theta: float) -> None:
        """Carry it elsewhere [m, m, rad]."""
        self._pose = np.array((x, y, theta))

    @property
    def stopped(self) -> bool:
        """Whether it is commanded to stand."""
        return not self._command.any()

    def close(self) -> None:
        """Leave the network, as a robot that loses power; `start` brings it back where it was."""
        self._quit.set()
        if self._thread is not None:
            self._thread.join()
            self._executor.shutdown()
            self._node.destroy_node()
            self._context.shutdown()
            self._thread = None
        self._quit.clear()
        self._command = self._still

    def _run(self) -> None:
        while not self._quit.is_set():
            self._executor.spin_once(timeout_sec=0.25 * STEP)
            now = time.monotonic()
            if now - self._began - self._steps * STEP > BEHIND:
                self._began = now - (self._steps + 1) * STEP
            while self._began + (self._steps + 1) * STEP <= now:
                self._steps += 1
                self._step(now)

    def _take(self, message: Any) -> None:
        twist = message.twist if self._robot.stamped else message
        v, vy, omega = twist.linear.x, twist.linear.y, twist.angular.z
        command = np.array((v, omega) if len(self._still) == 2 else (v, vy, omega))
        if np.isfinite(command).all():
            self._command, self._heard = command, time.monotonic()
            self.commands += 1

    def _step(self, now: float) -> None:
        """One step of the physics, and what is due after it."""
        if now - self._heard > WATCHDOG:
            self._command = self._still
        before = self._pose
        self._pose = self._plant.trace(before, self._command, STEP, 1)[0]
        gap = obstacle_gaps(self._scenario, self._pose[None], np.zeros(1))[0]
        self.clearance = min(self.clearance, float(gap))
        here, frame = Place(*self._pose.tolist()), "map"
        if self._robot.drifts:
            here, frame = Place(*self._scenario.start).inverse.of(here), "odom"
        moved = (self._pose - before) / STEP
        v, vy = rotate(moved[0], moved[1], -before[2] - 0.5 * STEP * moved[2])
        odometry = Odometry(header=self._header(frame), child_frame_id="base_link")
        odometry.pose.pose, twist = _pose(here), odometry.twist.twist
        twist.linear.x, twist.linear.y, twist.angular.z = float(v), float(vy), float(moved[2])
        self._publish("/clock", lambda: Clock(clock=self._stamp()))
        self._publish("odom", lambda: odometry)
        if self._steps % LOCALISED_EVERY == 1:
            self._publish("amcl_pose", self._localised)
        if self._steps % SCAN_EVERY == 1:
            self._publish("scan", self._scan)

    def _publish(self, name: str, make: Any) -> None:
        if name in self._publishers and name not in self.silent:
            self._publishers[name].publish(make())

    def _localised(self) -> PoseWithCovarianceStamped:
        found = PoseWithCovarianceStamped(header=self._header("map"))
        found.pose.pose = _pose(Place(*self._pose.tolist()))
        return found

    def _scan(self) -> LaserScan:
        x, y, theta = self._pose
        angles = theta - math.pi + math.tau / BEAMS * np.arange(BEAMS)
        ranges = self._world.ranges(np.array((x, y)), angles, FARTHEST)
        return LaserScan(
            header=self._header("base_link"),
            angle_min=-math.pi,
            angle_max=math.pi,
            angle_increment=math.tau / BEAMS,
            range_min=0.01,
            range_max=FARTHEST,
            ranges=ranges.astype(np.float32),
        )

    def _map(self) -> OccupancyGrid:
        cells = self._world.cells()
        height, width = cells.cells.shape
        grid = OccupancyGrid(header=self._header("map"))
        grid.info.resolution, grid.info.width, grid.info.height = cells.resolution, width, height
        grid.info.origin = _pose(Place(*cells.origin, 0.0))
        grid.data = cells.cells.reshape(-1).tolist()
        return grid

    def _header(self, frame: str) -> Header:
        return Header(stamp=self._stamp(), frame_id=frame)

    def _stamp(self) -> Time:
        seconds = self._steps * STEP if self._robot.simulated_time else time.time()
        whole = math.floor(seconds)
        return Time(sec=whole, nanosec=int((seconds - whole) * 1e9))


def _pose(place: Place) -> Pose:
    pose = Pose()
    pose.position.x, pose.position.y = float(place.x), float(place.y)
    half = 0.5 * float(place.theta)
    pose.orientation.z, pose.orientation.w = math.sin(half), math.cos(half)
    return pose
