"""A robot behind ROS 2 topics, as the bridge's gate and loop know robots: a node of rclpy."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

from firmware_bridge.kinematics import curvature_of
from firmware_bridge.messages import LinkError, LinkStatus, State
from firmware_bridge.ros2.geometry import Place, PoseInput, Transforms, place_of, seconds
from firmware_bridge.ros2.obstacles import GridInput, ScanInput
from firmware_bridge.ros2.options import Ros2Options
from firmware_bridge.wheels import Wheels

QUIET = 1.0
"""Without a goal zeros are published for so long, and then nothing: others may drive [s]."""
SILENT, RATES, SPAN = 0.5, (0.8, 1.25), 2.0
"""Age from which a simulator's clock counts as stopped [s]; how much slower or faster than real
time it may run, since the controller's period and the gate's patience are of real time; over which
time that is measured [s]."""
ENDS = 10.0  # how long its threads may take to end, on a busy computer [s]
LOOK = 1.0  # between two looks at what others publish, and at maps that wait for a transform [s]
DIFFERS = 0.1  # smallest difference of clocks that is reported [s]
SENSOR = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""As map servers and AMCL publish: whoever comes late gets the last one."""
NEWEST = QoSProfile(depth=1)
Goal = tuple[float, float, float]  # x, y [m] and heading [rad] in the frame that is driven in


class Ros2Driver:
    """Listens to odometry, obstacles and goals, and publishes commands.

    `node`: spun by a thread of this driver. `options`: what it listens to. `wheels`: of the robot;
    a car with a wheelbase is commanded by AckermannDriveStamped. `scan_age`: oldest scan to drive
    by [s].
    """

    def __init__(
        self, node: Node, options: Ros2Options, wheels: Wheels, scan_age: float = 0.5
    ) -> None:
        self.node, self.options, self.wheels = node, options, wheels
        self.transforms = Transforms(node, options.transform_tolerance)
        lookup = self.transforms.lookup
        mount = options.scan_mount
        self.pose = PoseInput(options.global_frame, None if options.use_amcl_pose else lookup)
        self.grids = [GridInput(name, options, lookup) for name in options.maps.split()]
        self.scans = [ScanInput(name, mount, scan_age, lookup) for name in options.scans.split()]
        self._on_goal: Callable[[Goal], str] | None = None
        self._early: Goal | None = None  # a goal that came before anybody took goals
        self._is_wanted: Callable[[], bool] = lambda: True
        self.path: list[Place] = []  # of another planner, if it is followed
        self.refused_goal = ""  # why the newest goal was not taken
        self.counters = Counter(messages=0, errors=0, commands=0)
        self._last_error, self._differ = "", ""
        self._ticks: deque[tuple[float, float]] = deque()  # our time and the simulator's [s]
        self._curvature, self._idle_since = 0.0, -math.inf
        self._executor: SingleThreadedExecutor | None = None
        self._threads: list[threading.Thread] = []
        self._new_map, self._closed = threading.Event(), False
        self._commands: Any = None

    def serve(self, on_goal: Callable[[Goal], str], is_wanted: Callable[[], bool]) -> None:
        """Hand goals to whoever drives there.

        `on_goal`: takes a goal, and says why it is refused; empty if it is not. `is_wanted`:
        whether there is a goal: without one, others may command the robot.
        """
        self._on_goal, self._is_wanted = on_goal, is_wanted
        if self._early is not None:
            self._offer(self._early)

    def _offer(self, goal: Goal) -> None:
        self._early = goal
        self.refused_goal = "" if self._on_goal is None else self._on_goal(goal)

    @property
    def simulated(self) -> bool:
        """Whether time is that of /clock."""
        return bool(self.node.get_parameter("use_sim_time").value)

    def connect(self, timeout: float) -> None:
        """Subscribe, and wait for odometry; LinkError after `timeout` [s]."""
        self._subscribe()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        for work, name in ((self._executor.spin, "ros2"), (self._mind_maps, "ros2-maps")):
            self._threads.append(threading.Thread(target=work, name=name, daemon=True))
            self._threads[-1].start()
        until = time.monotonic() + timeout
        while self.pose.filter.latest is None:
            if time.monotonic() > until:
                self._look()
                topic = self.node.resolve_topic_name("odom")
                raise LinkError(
                    f"no odometry on {topic} after {timeout:g} s: "
                    f"{self._differ or 'does the robot run, in this ROS_DOMAIN_ID?'}"
                )
            time.sleep(0.02)

    def _subscribe(self) -> None:
        from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist, TwistStamped
        from nav_msgs.msg import OccupancyGrid, Odometry, Path
        from sensor_msgs.msg import LaserScan

        self._types: dict[str, type] = {}
        self._hear("odom", Odometry, SENSOR, self._take_odometry)
        if self.options.use_amcl_pose:
            take = self.pose.take_localisation
            self._hear("amcl_pose", PoseWithCovarianceStamped, LATCHED, lambda m, now: take(m))
        for scan in self.scans:
            self._hear(scan.name, LaserScan, SENSOR, lambda m, now, s=scan: self._scan(s, m, now))
        for grid in self.grids:
            self._hear(grid.name, OccupancyGrid, LATCHED, grid.take)
            self._hear_updates(grid)
        if self.options.follow_plan:
            self._hear("plan", Path, NEWEST, self._take_plan)
        else:
            self._hear("goal_pose", PoseStamped, NEWEST, lambda m, now: self._take_goal(m))
        kind = TwistStamped if self.options.enable_stamped_cmd_vel else Twist
        if self.wheels.wheelbase:
            from ackermann_msgs.msg import AckermannDriveStamped

            kind = AckermannDriveStamped
        self._commands = self.node.create_publisher(kind, "cmd_vel", NEWEST)

    def _hear(self, name: str, kind: type, qos: QoSProfile, take: Callable[..., object]) -> None:
        def receive(message: Any) -> None:
            self.counters["messages"] += 1
            self._guarded(lambda: take(message, time.monotonic()))()
            if kind.__name__.startswith("OccupancyGrid"):
                self._new_map.set()

        self._types[self.node.resolve_topic_name(name)] = kind
        self.node.create_subscription(kind, name, receive, qos)

    def _hear_updates(self, grid: GridInput) -> None:
        try:
            from map_msgs.msg import OccupancyGridUpdate
        except ImportError:  # a map whose updates are published is refused: see `health`
            return
        self._hear(f"{grid.name}_updates", OccupancyGridUpdate, QoSProfile(depth=50), grid.update)

    def _guarded(self, action: Callable[[], object]) -> Callable[[], None]:
        def act() -> None:
            try:
                action()
            except Exception as error:  # whatever is on the network, the robot goes on
                self.counters["errors"] += 1
                self._last_error = f"{type(error).__name__}: {error}"

        return act

    def _local(self, stamp: Any, now: float) -> float:
        """Time of a stamp as far as it is known: on our clock if it is a simulator's [s]."""
        if not self.simulated:
            return seconds(stamp)
        return now + seconds(stamp) - self._ros_time()

    def _ros_time(self) -> float:
        return float(1e-9 * self.node.get_clock().now().nanoseconds)

    def _take_odometry(self, message: Any, now: float) -> None:
        self.pose.take_odometry(message, self._local(message.header.stamp, now), now)

    def _scan(self, scan: ScanInput, message: Any, now: float) -> None:
        first = self.pose.on_our_clock(self._local(message.header.stamp, now))
        scan.take(message, first, self.pose.base, now)

    def _take_goal(self, message: Any) -> None:
        at = place_of(message.pose.position, message.pose.orientation)
        frame, own = self.options.global_frame, message.header.frame_id
        found = self.transforms.lookup(frame, own) if own else None
        if at is None:
            self.refused_goal = "it is not finite, or has no orientation"
        elif found is None:
            self.refused_goal = f"no transform {frame} -> {own or '(no frame)'}"
        else:
            self._offer(found.of(at)[:3])
        if self.refused_goal:
            self.node.get_logger().warning(f"goal refused: {self.refused_goal}")

    def _take_plan(self, message: Any, now: float) -> None:
        """Take the path of another planner; drive to its end if that is another one."""
        found = self.transforms.lookup(self.options.global_frame, message.header.frame_id)
        poses = [place_of(row.pose.position, row.pose.orientation) for row in message.poses]
        if found is None or len(poses) < 2 or None in poses:
            self.refused_goal = "plan: expected two poses or more, in a frame that TF knows"
            return
        before, self.path = self.path[-1:], [found.of(pose) for pose in poses if pose is not None]
        if before != self.path[-1:]:
            self._offer(self.path[-1][:3])

    def obstacles(self, at: float) -> tuple[list[Any], Any] | None:
        """Obstacles for a robot whose pose is of the time `at` [s], and the first scan among them.

        None if a map or a scan is missing.
        """
        now = time.monotonic()
        scans = [scan.scan(at, now) for scan in self.scans]
        found = [*(grid.grid for grid in self.grids), *scans]
        return None if any(one is None for one in found) else (found, scans[0] if scans else None)

    def state(self) -> State | None:
        """Newest pose."""
        return self.pose.state()

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        """Publish forward speed [m/s], turn rate [rad/s], and an omni's speed to the left [m/s]."""
        if not all(map(math.isfinite, (v, omega, vy))):
            raise ValueError(f"expected finite speeds, got {v}, {omega} and {vy}")
        now = time.monotonic()
        if v or omega or vy or self._is_wanted():
            self._idle_since = now
        if now - self._idle_since <= QUIET:
            self.counters["commands"] += 1
            self._commands.publish(self.command(v, omega, vy))

    def stop(self) -> None:
        """Publish zero."""
        if self._commands is not None and time.monotonic() - self._idle_since <= QUIET:
            self._commands.publish(self.command(0.0, 0.0, 0.0))

    def command(self, v: float, omega: float, vy: float) -> Any:
        """Message of a command, of the type that is published."""
        message = self._commands.msg_type()
        if self.wheels.wheelbase or self.options.enable_stamped_cmd_vel:
            message.header.stamp = self.node.get_clock().now().to_msg()
            message.header.frame_id = self.pose.base
        if self.wheels.wheelbase:
            self._curvature = curvature_of(v, omega, 1.0 / self.wheels.radius, self._curvature)
            message.drive.speed = float(v)
            message.drive.steering_angle = math.atan(self.wheels.wheelbase * self._curvature)
            return message
        twist = message.twist if self.options.enable_stamped_cmd_vel else message
        twist.linear.x, twist.linear.y, twist.angular.z = float(v), float(vy), float(omega)
        return message

    def health(self) -> LinkStatus:
        """What is known of the other end: odometry is its heartbeat."""
        now, state = time.monotonic(), self.state()
        clock, fault = self._clock_problem(now), self.pose.filter.fault(now)
        problems = (clock, fault, *(grid.problem(now) for grid in self.grids))
        blind = tuple(filter(None, (scan.problem(now) for scan in self.scans)))
        if state is None:
            problems = (self.pose.problem(now), *problems)
        stamps = [scan.stamp for scan in self.scans]
        odometry = {f"odometry_{name}": n for name, n in self.pose.filter.counters.items()}
        return LinkStatus(
            connected=True,
            heartbeat_stamp=now,
            pose_stamp=-math.inf if state is None else state.stamp,
            ready=True,
            pose_ok=not (clock or fault),
            faults=tuple(dict.fromkeys(filter(None, problems))),
            counters={**self.counters, "not_finite": self.pose.refused, **odometry},
            scan_stamp=-math.inf if blind else min(stamps, default=None),
            scan_faults=blind,
        )

    def _clock_problem(self, now: float) -> str:
        """Why simulated time cannot be driven by, empty if it can."""
        if not self.simulated:
            return ""
        said, ticks = self._ros_time(), self._ticks
        if ticks and said < ticks[-1][1]:
            ticks.clear()  # a simulation that was begun anew
        if not ticks or said > ticks[-1][1]:
            ticks.append((now, said))
        while len(ticks) > 1 and now - ticks[0][0] > SPAN:
            ticks.popleft()
        if now - ticks[-1][0] > SILENT or not said:
            return "no simulated time on /clock"
        span = ticks[-1][0] - ticks[0][0]
        rate = (said - ticks[0][1]) / span if span > SILENT else 1.0
        if RATES[0] <= rate <= RATES[1]:
            return ""
        return f"simulated time runs at {rate:.2f} of real time: expected 0.8 to 1.25"

    def clock_offset(self) -> float | None:
        """How far our system's clock is ahead of the odometry's [s]; None if not known."""
        way = self.pose.filter.shortest_way
        known = not self.simulated and math.isfinite(way)
        return way + time.time() - time.monotonic() if known else None

    def _mind_maps(self) -> None:
        """Make grids in a thread of their own: of large maps that takes longer than poses wait."""
        while not self._closed:
            self._new_map.wait(LOOK)
            self._new_map.clear()
            self._guarded(self._look)()

    def _look(self) -> None:
        """Make grids of maps; see whether others use our topics with other types than ours."""
        for grid in self.grids:
            grid.build()
            updates = f"{grid.name}_updates"
            resolved = self.node.resolve_topic_name(updates)
            if resolved not in self._types and self.node.count_publishers(updates):
                grid.refused = f"{resolved} is published, but map_msgs is not installed"
        self._differ = next(filter(None, self._differing()), "")

    def _differing(self) -> Sequence[str]:
        pairs = [
            (topic, self.node.get_publishers_info_by_topic(topic), kind, "published")
            for topic, kind in self._types.items()
        ]
        commands = self._commands.topic_name
        heard = self.node.get_subscriptions_info_by_topic(commands)
        pairs.append((commands, heard, self._commands.msg_type, "heard"))
        return [
            f"{topic} is {how} as {other.topic_type}, expected {name}"
            for topic, others, kind, how in pairs
            for other in others
            if other.topic_type != (name := _name(kind))
        ]

    def warnings(self) -> tuple[str, ...]:
        """What a user should know once."""
        offset, words = self.clock_offset(), ""
        if offset is not None and abs(offset) >= DIFFERS:
            behind = "behind" if offset > 0 else "ahead of"
            words = f"the odometry's clock is {abs(offset):.2f} s {behind} ours"
        goal = self.refused_goal and f"goal refused: {self.refused_goal}"
        missing = self.transforms.missing
        return tuple(filter(None, (self._differ, words, goal, missing, self._last_error)))

    def close(self) -> None:
        """Leave the network; idempotent."""
        self._closed = True
        self._new_map.set()
        if self._executor is not None:
            self._executor.shutdown(timeout_sec=ENDS)
        # a node that is taken from under a thread aborts the process
        for thread in self._threads:
            thread.join(ENDS)
        self.node.destroy_node()


def _name(kind: Any) -> str:
    """Name of a message's type: geometry_msgs/msg/Twist."""
    return f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
