"""What the node makes of messages: poses, scans, maps, goals, times; and what it refuses."""

import math
from functools import reduce
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import ros_stubs
from ros2_drive import NO_ROS

pytest.importorskip("rclpy", reason=NO_ROS)

from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from nav_msgs.msg import Path as PathMessage
from rclpy.time import Time
from sensor_msgs.msg import LaserScan

import firmware_bridge.ros2.driver as module
from firmware_bridge.messages import ConfigError
from firmware_bridge.ros2.driver import Ros2Driver
from firmware_bridge.ros2.geometry import GivenPath, Place
from firmware_bridge.ros2.options import Ros2Options, read_parameters
from firmware_bridge.wheels import Wheels

EPOCH, NAN = 1.7e9, math.nan


class Now:
    """A node that is not on any network, whose clock and ours the test sets."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now, self.simulated = 100.0, None
        clock = SimpleNamespace(time=time, monotonic=lambda: self.now)
        monkeypatch.setattr(module, "time", SimpleNamespace(**vars(clock), sleep=None))

    def get_clock(self) -> Any:
        seconds = EPOCH + self.now if self.simulated is None else self.simulated
        return SimpleNamespace(now=lambda: Time(nanoseconds=round(1e9 * seconds)))

    def get_parameter(self, name: str) -> Any:
        return SimpleNamespace(value=self.simulated is not None)

    def get_logger(self) -> Any:
        return SimpleNamespace(warning=lambda text: None)


def time() -> float:
    return EPOCH + 100.0


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Now:
    return Now(monkeypatch)


def driver(node: Now, wheels: Wheels | None = None, **options: Any) -> Ros2Driver:
    chosen = Ros2Options(**{"maps": "", "scans": "", **options})
    made = Ros2Driver(node, chosen, wheels or Wheels())
    made.serve(lambda goal: "", lambda: True)
    return made


def spoil(message: Any, changes: dict[str, Any]) -> Any:
    """A message with some of its parts changed, such as ``info.width``."""
    for path, value in changes.items():
        *parts, last = path.split(".")
        setattr(reduce(getattr, parts, message), last, value)
    return message


def stamp(message: Any, seconds: float, frame: str) -> Any:
    message.header.stamp.sec = math.floor(seconds)
    message.header.stamp.nanosec = round(1e9 * (seconds - math.floor(seconds)))
    message.header.frame_id = frame
    return message


def put(pose: Any, x: float, y: float, theta: float) -> None:
    pose.position.x, pose.position.y = float(x), float(y)
    pose.orientation.z, pose.orientation.w = math.sin(theta / 2), math.cos(theta / 2)


def odometry(
    here: Ros2Driver, node: Now, pose: Any, frame: str = "odom", at: float | None = None
) -> None:
    message = Odometry(child_frame_id="base_link")
    put(message.pose.pose, *pose)
    message.twist.twist.linear.x, message.twist.twist.angular.z = 0.2, 0.1
    when = EPOCH + node.now if at is None else at
    here._take_odometry(stamp(message, when, frame), node.now)


def test_odometry_is_brought_into_the_maps_frame_by_tf(node, monkeypatch) -> None:
    buffer = ros_stubs.install(monkeypatch)
    here = driver(node)
    odometry(here, node, (1.0, 0.0, 0.5))
    assert here.state() is None
    assert here.health().faults == ("no fresh map -> odom in TF",)
    buffer.known["map", "odom"] = (2.0, 3.0, math.pi / 2, EPOCH + 100.0)
    state = here.state()
    assert (state.x, state.y, state.theta) == pytest.approx((2.0, 4.0, 0.5 + math.pi / 2))
    assert (state.v, state.omega) == (0.2, 0.1) and state.stamp == pytest.approx(100.0)
    # a localisation that fell silent is not believed for ever
    node.now = 101.9
    assert here.state() is not None
    node.now = 102.1
    assert here.state() is None


def test_without_tf2_it_says_what_is_missing(node, monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "tf2_ros", None)
    here = driver(node)
    odometry(here, node, (1.0, 0.0, 0.5))
    assert here.state() is None and "tf2_ros is not installed" in here.transforms.missing


def test_amcl_says_where_the_robot_was_when_its_scan_was_made(node) -> None:
    here = driver(node, use_amcl_pose=True)
    for k in range(50):
        node.now = 100.0 + 0.02 * k
        odometry(here, node, (0.02 * k, 0.0, 0.0))
    assert here.health().faults == ("no fresh map -> odom on amcl_pose",)
    message = PoseWithCovarianceStamped()
    put(message.pose.pose, 5.0, 5.0, math.pi / 2)
    here.pose.take_localisation(stamp(message, EPOCH + 100.5, "map"))
    # half a metre has been driven since
    state = here.state()
    assert (state.x, state.y) == pytest.approx((5.0, 5.48), abs=0.011)
    here.pose.take_localisation(stamp(message, EPOCH + 50.0, "map"))
    here.pose.take_localisation(stamp(message, EPOCH + 100.5, "moon"))
    assert here.pose.refused == 2 and here.state() == state


@pytest.mark.parametrize("value", [NAN, math.inf, 1e300])
@pytest.mark.parametrize("part", ["pose.pose.position.x", "twist.twist.linear.x"])
def test_odometry_that_is_not_finite_is_refused(node, part: str, value: float) -> None:
    here = driver(node)
    message = Odometry()
    message.pose.pose.orientation.w = 1.0
    here._take_odometry(stamp(spoil(message, {part: value}), EPOCH, "map"), 100.0)
    assert here.state() is None and here.pose.refused == 1
    assert here.health().faults == ("odometry is not finite",)


def test_ages_count_from_the_stamp_whatever_the_senders_clock(node) -> None:
    here = driver(node)
    for k in range(20):
        node.now = 100.0 + 0.02 * k
        odometry(here, node, (0.0, 0.0, 0.0), "map", 5.0 + 0.02 * k)
    node.now = 100.6  # a pose that waited for 0.2 s on the way is 0.2 s old
    odometry(here, node, (0.0, 0.0, 0.0), "map", 5.4)
    assert here.state().stamp == pytest.approx(100.4)
    assert here.clock_offset() > 1e9 and "s behind ours" in here.warnings()[0]


@pytest.mark.parametrize(
    ("rate", "problem"), [(1.0, ""), (0.5, "0.50 of real time"), (3.0, "3.00 of real time")]
)
def test_simulated_time_runs_about_as_real_time(node, rate: float, problem: str) -> None:
    here = driver(node)
    node.simulated = 0.0
    assert here.health().faults[-1] == "no simulated time on /clock"
    for k in range(1, 130):
        node.now, node.simulated = 100.0 + 0.02 * k, rate * 0.02 * k
        odometry(here, node, (0.0, 0.0, 0.0), "map", node.simulated)
        faults = here.health().faults
    assert (faults == ()) if not problem else problem in faults[0]
    node.now += 1.0
    assert "no simulated time on /clock" in here.health().faults


SCAN = {"angle_min": 0.0, "angle_increment": 1.0, "range_max": 8.0, "range_min": 0.01}


def scan(frame: str = "laser", at: float = EPOCH + 99.95) -> LaserScan:
    return stamp(LaserScan(ranges=[1.0, math.inf, NAN, 2.0], **SCAN), at, frame)


def test_a_scan_its_mount_and_its_age(node, monkeypatch) -> None:
    buffer = ros_stubs.install(monkeypatch)
    here = driver(node, scans="front")
    odometry(here, node, (0.0, 0.0, 0.0), "map")
    here._scan(here.scans[0], scan(), 100.0)
    told = ("front: no level base_link -> laser in TF, and no scan_mount",)
    assert here.health().scan_faults == told
    for roll, mirrored in ((0.0, False), (math.pi, True)):  # upright, and upside down
        buffer.known["base_link", "laser"], buffer.roll = (0.1, 0.0, math.pi / 2, 0.0), roll
        here._scan(here.scans[0], scan(), 100.0)
        assert here.health().scan_faults == ()
        _, found = here.obstacles(100.1)
        assert found.mount == pytest.approx((0.1, 0.0, math.pi / 2)) and found.mirrored == mirrored
        assert found.age == pytest.approx(0.15) and len(found) == 4
    buffer.roll = math.pi / 2
    here._scan(here.scans[0], scan(), 100.0)
    assert here.health().scan_faults == told
    node.now = 100.84
    assert here.obstacles(100.8) is None and here.health().scan_stamp == -math.inf


def test_several_scanners_are_all_needed(node) -> None:
    here = driver(node, scans="front rear", scan_mount=(0.1, 0.0, 0.0))
    odometry(here, node, (0.0, 0.0, 0.0), "map")
    here._scan(here.scans[0], scan(), 100.0)
    assert here.health().scan_faults == ("no scan on rear yet",) and here.obstacles(100.0) is None
    here._scan(here.scans[1], scan(), 100.0)
    found, first = here.obstacles(100.0)
    assert len(found) == 2 and first is found[0] and here.health().scan_faults == ()


WRONG_SCANS: dict[str, dict[str, Any]] = {
    "angle": {"angle_min": NAN},
    "limits": {"range_max": 0.0},
    "no beams": {"ranges": []},
    "a million beams": {"ranges": np.ones(10**6, np.float32)},
    "beams that last for years": {"time_increment": math.inf},
    "the future": {"header.stamp.sec": round(EPOCH) + 113},
}


@pytest.mark.parametrize("what", WRONG_SCANS)
def test_a_scan_that_is_none_is_reported_in_one_line_and_not_driven_by(node, what: str) -> None:
    here = driver(node, scans="scan")
    odometry(here, node, (0.0, 0.0, 0.0), "map")
    here._scan(here.scans[0], spoil(scan("base_link"), WRONG_SCANS[what]), 100.0)
    (text,) = here.health().scan_faults
    assert text.startswith("scan: ") and "\n" not in text and len(text) < 250
    # and the next good one is driven by
    here._scan(here.scans[0], scan("base_link"), 100.0)
    assert here.health().scan_faults == ()


def grid(rows: Any, resolution: float = 0.5, frame: str = "map") -> OccupancyGrid:
    cells = np.array(rows, np.int8)
    message = stamp(OccupancyGrid(), EPOCH, frame)
    message.info.resolution = resolution
    message.info.height, message.info.width = cells.shape
    put(message.info.origin, -1.0, -1.0, 0.0)
    message.data = cells.reshape(-1).tolist()
    return message


def test_a_map_its_update_its_frame_and_its_age(node, monkeypatch) -> None:
    buffer = ros_stubs.install(monkeypatch)
    here = driver(node, maps="map", map_age=2.0)
    odometry(here, node, (0.0, 0.0, 0.0), "map")
    (known,) = here.grids
    assert here.health().faults == ("no map on map yet",)
    known.take(grid([[0, 0, 0], [0, 100, 0]]), 100.0)
    known.build()
    assert here.health().faults == ()
    assert here.obstacles(100.0)[0][0].rectangles.tolist() == [[0.5, 0.5, 1.0, 1.0]]
    part = SimpleNamespace(x=0, y=0, width=2, height=1, data=[100, 100])
    known.update(part, 101.0)
    known.build()
    assert known.grid.occupied.tolist() == [[True, True, False], [False, True, False]]
    for x, width in ((-1, 2), (2, 2), (0, 2**31), (0, 1)):
        known.update(SimpleNamespace(x=x, y=0, width=width, height=1, data=[0, 0]), 101.0)
        assert "does not lie within the map" in here.health().faults[0]
    # a costmap that rolls with the robot lies in the frame of odometry
    known.take(grid([[0, 100]], frame="odom"), 101.0)
    known.build()
    assert here.health().faults == ("map: no fresh map -> odom in TF",)
    buffer.known["map", "odom"] = (5.0, 0.0, 0.0, EPOCH + 100.0)
    known.build()
    assert known.grid.origin == pytest.approx((4.0, -1.0, 0.0))
    node.now = 103.5
    odometry(here, node, (0.0, 0.0, 0.0), "map")
    assert here.health().faults == ("no map on map for 2.5 s",)


def test_a_costmaps_inflated_cells_are_free(node) -> None:
    here = driver(node, maps="costmap", map_threshold=100.0)
    here.grids[0].take(grid([[0, 99, 100]]), 100.0)
    here.grids[0].build()
    assert here.grids[0].grid.occupied.tolist() == [[False, False, True]]


TURNED = "info.origin.orientation"
WRONG_MAPS: dict[str, dict[str, Any]] = {
    "too few cells": {"info.height": 3},
    "four billion columns": {"info.width": 2**32 - 1},
    "no cells": {"info.width": 0, "info.height": 0, "data": []},
    "value": {"data": [0, 0, 0, 101]},
    "resolution": {"info.resolution": NAN},
    "origin": {"info.origin.position.x": math.inf},
    "orientation": {f"{TURNED}.w": 0.0},
    "tilted": {f"{TURNED}.x": 1.0, f"{TURNED}.w": 0.0},
}


@pytest.mark.parametrize("what", WRONG_MAPS)
def test_a_map_that_is_none_is_reported_in_one_line_and_not_driven_by(node, what: str) -> None:
    here = driver(node, maps="map")
    odometry(here, node, (0.0, 0.0, 0.0), "map")
    here.grids[0].take(spoil(grid([[0, 0], [0, 100]]), WRONG_MAPS[what]), 100.0)
    here.grids[0].build()
    (text,) = here.health().faults
    assert text.startswith("map: ") and "\n" not in text and len(text) < 250
    assert here.obstacles(100.0) is None


def goal_message(frame: str, **changes: Any) -> PoseStamped:
    message = stamp(PoseStamped(), EPOCH, frame)
    put(message.pose, 1.0, 1.0, 0.5)
    return spoil(message, {key.replace("__", "."): value for key, value in changes.items()})


def test_goals_come_in_any_frame_that_a_transform_leads_to(node, monkeypatch) -> None:
    ros_stubs.install(monkeypatch).known["map", "odom"] = (2.0, 0.0, 0.0, EPOCH + 100.0)
    here, goals = driver(node), []
    here.serve(lambda goal: goals.append(goal) or "", lambda: True)
    here._take_goal(goal_message("odom"))
    assert goals == [pytest.approx((3.0, 1.0, 0.5))] and here.refused_goal == ""


@pytest.mark.parametrize(
    ("frame", "changes"),
    [("", {}), ("moon", {}), ("map", {"pose__position__y": NAN}), ("map", {"w": 0})],
)
def test_goals_that_are_none_are_refused_in_one_line(node, monkeypatch, frame, changes) -> None:
    ros_stubs.install(monkeypatch)
    here, goals = driver(node), []
    here.serve(lambda goal: goals.append(goal) or "", lambda: True)
    message = goal_message(frame, **{k: v for k, v in changes.items() if k != "w"})
    if "w" in changes:
        message.pose.orientation.w = message.pose.orientation.z = 0.0
    here._take_goal(message)
    assert goals == [] and here.refused_goal and "\n" not in here.refused_goal


def commanded(here: Ros2Driver, kind: type) -> Any:
    here._commands = SimpleNamespace(msg_type=kind)
    return here


def test_commands_of_all_wheels(node) -> None:
    twist = commanded(driver(node, Wheels("omni")), Twist).command(0.3, -0.5, 0.1)
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == (0.3, 0.1, -0.5)
    wheels = Wheels("car", wheelbase=0.3, steering_angle=0.5)
    car = commanded(driver(node, wheels), ros_stubs.AckermannDriveStamped)
    drive = car.command(0.5, 0.5, 0.0).drive
    assert drive.speed == 0.5 and drive.steering_angle == pytest.approx(math.atan(0.3))
    # who stands keeps its wheels where they are
    assert car.command(0.0, 0.0, 0.0).drive.steering_angle == pytest.approx(math.atan(0.3))
    with pytest.raises(ValueError, match="finite"):
        car.send(NAN, 0.0)


def test_parameters_are_those_of_the_node_or_keys_of_a_robot_file() -> None:
    options, keys = read_parameters({"use_sim_time": True, "scans": "a b", "control.model": "m"})
    assert options.scans == "a b" and keys == {"control": {"model": "m"}}
    for wrong, told in (
        ({"scan": "a"}, "parameter scan: unknown"),
        ({"limit.v_max": 1.0}, "parameter limit.v_max: unknown"),
        ({"map_threshold": "x"}, "map_threshold: expected float"),
        ({"map_threshold": 0.0}, "map_threshold: expected 1 to 100"),
        ({"scan_mount": [0.0, 1.0]}, "scan_mount: expected"),
    ):
        with pytest.raises(ConfigError, match=told):
            read_parameters(wrong)


def test_a_path_of_another_planner(node) -> None:
    here, goals = driver(node, follow_plan=True), []
    here.serve(lambda goal: goals.append(goal) or "", lambda: True)
    path = stamp(PathMessage(), EPOCH, "map")
    for k in range(5):
        path.poses.append(PoseStamped())
        put(path.poses[-1].pose, k, 0.0, 0.1)
    for _ in range(2):  # the same goal again is not a new one
        here._take_plan(path, 100.0)
    assert goals == [(4.0, 0.0, pytest.approx(0.1))]
    here._take_plan(stamp(PathMessage(), EPOCH, "map"), 100.0)
    assert "two poses" in here.refused_goal
    planner = GivenPath(lambda: here.path, by_poses=False)
    request = SimpleNamespace(
        start=np.zeros(3),
        goal=np.array((4.0, 0.0, 0.1)),
        inflation=0.2,
        distances=lambda points: np.full(len(points), 1.0),
    )
    planner.begin(request)
    assert np.abs(planner.path().poses[:, 1]).max() < 0.02 and planner.path().clearance == 0.8
    request.goal = np.array((0.0, 4.0, 0.0))
    planner.begin(request)
    assert "no path to this goal" in planner.path()
    assert Place(1.0, 2.0, 0.5).of(Place(1.0, 2.0, 0.5).inverse) == pytest.approx((0, 0, 0, 1))
