"""A robot among a scenario's obstacles whose only link are ROS 2 topics."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from firmware_bridge.link.url import LinkUrl
from firmware_bridge.messages import ConfigError
from firmware_bridge.ros2.message_types import CLOCK, GRID, ODOMETRY, SCAN, TF, TWIST, TWIST_STAMPED
from firmware_bridge.ros2.names import Qos
from firmware_bridge.ros2.node import Node, NodeOptions, Publisher, Subscription
from firmware_bridge.ros2.transforms import planar, planar_matrix
from kmpc_lab.emulator.ros2.messages import RobotMessages
from kmpc_lab.emulator.ros2.world import World
from kmpc_lab.sim.plants.plant import scenario_plant
from kmpc_lite.control import Footprint
from kmpc_lite.geometry import rotate
from kmpc_lite.learn.formats.ackermann import ACKERMANN_STAMPED
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.gaps import obstacle_gaps
from kmpc_lite.types import Array

STEP = 0.02
"""Of the physics, and between two odometry messages [s]."""
MOTOR_LAG = 0.05
SCANNER = (0.05, 0.0, 0.0)
"""Where the scanner sits on the robot [m, m, rad]."""
LATCHED = Qos(transient_local=True, depth=1)
BEHIND = 1.0
"""A simulator that is farther behind does not catch up [s]."""


@dataclass(frozen=True)
class EmulatedRobot:
    """Which sensors it has, and how it is commanded."""

    sees: tuple[str, ...] = ("map", "scan")
    """Which topics tell of obstacles."""
    stamped: bool = False
    """Whether it listens to TwistStamped."""
    wheelbase: float = 0.0
    """Of a car that listens to AckermannDriveStamped [m]."""
    simulated_time: bool = False
    """Whether stamps count from the start, and /clock is published."""
    watchdog: float = 0.5
    """It stops when it hears no command for so long [s]."""
    beams: int = 360
    farthest: float = 8.0
    """How far the scanner sees [m]."""
    scan_period: float = 0.1
    """[s]"""


class Ros2Emulator:
    """Publishes odometry, transforms, scan and map, and obeys cmd_vel, on the scenario's wheels.

    Odometry begins at zero, wherever the robot stands: ``map -> odom`` tells where that is, as a
    localisation does.

    Parameters
    ----------
    node : NodeOptions
        Its node, and where the network is; `start` makes it the router of another place.
    scenario : Scenario
        Start, floor and obstacles.
    robot : EmulatedRobot
        What it has.
    seed : int
        Of the slip.
    clock, stamps : callable
        Monotonic time, and the time of stamps [s].
    """

    def __init__(
        self,
        node: NodeOptions,
        scenario: Scenario,
        robot: EmulatedRobot | None = None,
        seed: int = 0,
        clock: Callable[[], float] = time.monotonic,
        stamps: Callable[[], float] = time.time,
    ) -> None:
        self._options, self._scenario = node, scenario
        self._robot = EmulatedRobot() if robot is None else robot
        self._clock, self._stamps = clock, stamps
        self._world = World(scenario)
        # which lags only on wheels on either side
        driven = replace(scenario, seed=seed, lag=scenario.lag or MOTOR_LAG)
        self._plant = scenario_plant(driven)
        self._pose = np.array(scenario.start, dtype=float)
        self._still = np.zeros(scenario.problem().wheels.inputs)
        self._command, self._heard = self._still, -math.inf
        self.commands = 0
        """Number of commands that came."""
        self._began = self._now = clock()
        self._steps = 0
        self._lock = threading.Lock()
        self.node: Node | None = None
        """Its session, while it is there."""
        self._publishers: dict[str, Publisher] = {}
        self._listener: Subscription | None = None
        self._quit = threading.Event()
        self._thread: threading.Thread | None = None

    def start(self, url: str) -> None:
        """Be the router at tcp:HOST:PORT, and the robot; LinkError where the port is taken."""
        link = LinkUrl.parse(url)
        if link.kind != "tcp":
            raise ConfigError(f"link {url}: the topics of a robot are served at tcp:HOST:PORT")
        host, port = link.address()
        host = f"[{host}]" if ":" in host else host
        self._options = replace(self._options, router=True, listen=(f"tcp/{host}:{port}",))
        self.open()
        self._thread = threading.Thread(target=self._run, name="ros2-robot", daemon=True)
        self._thread.start()

    def open(self) -> None:
        """Appear on the network, without a thread of its own."""
        robot = self._robot
        self.node = node = Node(self._options)
        node.open()
        topics = [("odom", ODOMETRY, Qos()), ("/tf", TF, Qos(depth=100))]
        topics.append(("/tf_static", TF, LATCHED))
        if "scan" in robot.sees:
            topics.append(("scan", SCAN, Qos(reliable=False, depth=5)))
        if "map" in robot.sees:
            topics.append(("map", GRID, LATCHED))
        if robot.simulated_time:
            topics.append(("/clock", CLOCK, Qos(reliable=False, depth=1)))
        self._publishers = {name: node.publisher(name, kind, qos) for name, kind, qos in topics}
        kind = TWIST_STAMPED if robot.stamped else TWIST
        kind = ACKERMANN_STAMPED if robot.wheelbase else kind
        self._listener = node.subscription("cmd_vel", kind, Qos(depth=1))
        messages, stamp = RobotMessages(node.types), self._stamp()
        still = messages.transforms(("base_link", "laser", SCANNER), time=stamp)
        self._publishers["/tf_static"].publish(still)
        if "map" in robot.sees:
            self._publishers["map"].publish(messages.map(self._world.cells(), stamp, "map"))

    @property
    def pose(self) -> tuple[float, float, float]:
        """True x, y [m], theta [rad] in the map."""
        with self._lock:
            x, y, theta = self._pose.tolist()
        return x, y, theta

    @property
    def footprint(self) -> Footprint | None:
        """What it covers; none if it is round."""
        return self._scenario.footprint

    @property
    def stopped(self) -> bool:
        """Whether it is commanded to stand."""
        return not self._command.any()

    @property
    def clearance(self) -> float:
        """Distance between the edges of the robot and the nearest obstacle [m]."""
        return float(obstacle_gaps(self._scenario, self._pose[None], np.zeros(1))[0])

    def advance(self) -> None:
        """Drive on until now, and publish what the sensors see."""
        assert self.node is not None, "open comes first"
        self.listen()
        now = self._clock()
        if now - self._began - self._steps * STEP > BEHIND:
            self._began = now - (self._steps + 1) * STEP
        while self._began + (self._steps + 1) * STEP <= now + 1e-9:
            self._steps += 1
            self._step(self._began + self._steps * STEP)

    def close(self) -> None:
        """Leave the network, as a robot that loses power; `start` brings it back where it was."""
        self._quit.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        if self.node is not None:
            self.node.close()
            self.node = None
        self._quit.clear()
        self._command = self._still

    def listen(self) -> None:
        """Take the commands that have come."""
        assert self._listener is not None
        while (taken := self._listener.take()) is not None:
            if taken[0] is None:
                continue
            command = self._read(taken[0])
            if np.isfinite(command).all():
                self._command, self._heard = command, self._clock()
                self.commands += 1

    def _read(self, message: Any) -> Array:
        """What a message commands the wheels."""
        if self._robot.wheelbase:
            v = message.drive.speed
            return np.array((v, v * math.tan(message.drive.steering_angle) / self._robot.wheelbase))
        twist = message.twist if self._robot.stamped else message
        v, omega = twist.linear.x, twist.angular.z
        return np.array((v, omega) if len(self._still) == 2 else (v, twist.linear.y, omega))

    def _step(self, now: float) -> None:
        """One step of the physics, and what is due after it."""
        if now - self._heard > self._robot.watchdog:
            self._command = self._still
        before = self._pose
        with self._lock:
            self._pose = self._plant.trace(before, self._command, STEP, 1)[0]
        assert self.node is not None
        messages, stamp = RobotMessages(self.node.types), self._stamp()
        publish = {name: publisher.publish for name, publisher in self._publishers.items()}
        if self._robot.simulated_time:
            publish["/clock"](messages.clock(stamp))
        start = planar_matrix(*self._scenario.start)
        here = planar(np.linalg.inv(start) @ planar_matrix(*self._pose.tolist()))[:3]
        every = max(1, round(self._robot.scan_period / STEP))
        links = [("odom", "base_link", here)]
        if self._steps % every == 1:
            links.append(("map", "odom", self._scenario.start))
        publish["/tf"](messages.transforms(*links, time=stamp))
        moved = (self._pose - before) / STEP
        v, vy = rotate(moved[0], moved[1], -before[2] - 0.5 * STEP * moved[2])
        publish["odom"](messages.odometry(here, (v, moved[2], vy), stamp, "odom", "base_link"))
        if "scan" in publish and self._steps % every == 1:
            publish["scan"](messages.scan(self._ranges(), self._robot.farthest, stamp, "laser"))

    def _ranges(self) -> Array:
        eye = planar(planar_matrix(*self._pose.tolist()) @ planar_matrix(*SCANNER))
        beams = self._robot.beams
        angles = eye.theta - math.pi + 2.0 * math.pi / beams * np.arange(beams)
        return self._world.ranges(np.array(eye[:2]), angles, self._robot.farthest)

    def _stamp(self) -> float:
        """Time of a message sent now [s]."""
        return self._steps * STEP if self._robot.simulated_time else self._stamps()

    def _run(self) -> None:
        while not self._quit.wait(0.5 * STEP):
            self.advance()
