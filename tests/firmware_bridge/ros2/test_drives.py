"""Drives over a real ROS 2: `kmpc ros2` and a simulated robot, two processes on Fast DDS."""

import math
import signal
import time
from typing import Any

import pytest
from ros2_drive import Drive, short_course
from waiting import until

import kmpc_lite as kl

GOAL = "--goal 0.7 0 0"


def arrived(drive: Drive, report: dict[str, Any], goal: tuple[float, float] = (0.7, 0.0)) -> None:
    assert report["outcome"] == "arrived" and report["status"] == 0, report
    assert math.dist(drive.robot.pose[:2], goal) < 0.08
    assert drive.robot.clearance > 0.0
    assert report["loop"]["errors"] == report["loop"]["controller_errors"] == 0
    # who has arrived commands nothing more
    assert until(lambda: drive.robot.stopped)


def test_past_an_obstacle_by_scan_alone_with_odometry_that_drifts(tmp_path, monkeypatch) -> None:
    ros = "--ros-args -p maps:='' -p use_amcl_pose:=true"
    with Drive(tmp_path, monkeypatch, f"{GOAL} {ros}", sees=("scan",), drifts=True) as drive:
        arrived(drive, drive.report())


def test_past_an_obstacle_of_a_map_by_simulated_time_and_stamped_commands(tmp_path, monkeypatch):
    ros = "-p scans:='' -p use_sim_time:=true -p enable_stamped_cmd_vel:=true"
    record = tmp_path / "drive"
    with Drive(
        tmp_path,
        monkeypatch,
        f"{GOAL} --record {record} --ros-args {ros}",
        sees=("map",),
        stamped=True,
        simulated_time=True,
    ) as drive:
        arrived(drive, drive.report())
    from kmpc_lab.recording.drive_file import load_drive

    run = load_drive(record / "drive.mcap")
    assert run.outcome.value == "reached" and len(run.details.times) > 10


def test_an_omni_drives_sideways(tmp_path, monkeypatch) -> None:
    course = short_course(wheels=kl.Omni(), circles=(), goal=(0.2, 0.6, 0.0))
    file = tmp_path / "omni.toml"
    file.write_text('[robot]\nwheels = "omni"\n')
    with Drive(
        tmp_path, monkeypatch, f"{file} --goal 0.2 0.6 0 --ros-args -p maps:=''", course
    ) as drive:
        turned = []
        assert until(lambda: turned.append(abs(drive.robot.pose[2])) or drive.ended(), 40.0)
        arrived(drive, drive.report(), (0.2, 0.6))
        assert max(turned) < 0.3


@pytest.fixture
def others(monkeypatch):
    """A node beside both."""
    rclpy = pytest.importorskip("rclpy")
    nodes = []

    def join(drive: Drive) -> Any:
        context = rclpy.Context()
        rclpy.init(args=["--ros-args", "-r", f"__ns:={drive.namespace}"], context=context)
        nodes.append((context, rclpy.create_node("others", context=context)))
        return nodes[-1][1]

    yield join
    for context, node in nodes:
        node.destroy_node()
        context.shutdown()


def spin(node: Any, condition: Any, seconds: float = 30.0) -> bool:
    from rclpy.executors import SingleThreadedExecutor

    executor = SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.05)
    return bool(condition())


def test_a_goal_of_rviz_odometry_that_stops_and_jumps_and_what_others_see(
    tmp_path, monkeypatch, others
) -> None:
    from diagnostic_msgs.msg import DiagnosticArray
    from geometry_msgs.msg import PoseStamped
    from nav_msgs.msg import Path
    from std_srvs.srv import SetBool
    from visualization_msgs.msg import MarkerArray

    course = short_course(circles=(), goal=(1.5, 0.0, 0.0))
    with Drive(tmp_path, monkeypatch, "--ros-args -p maps:=''", course) as drive:
        node, heard = others(drive), {}
        for kind, name in (
            (Path, "kmpc/plan"),
            (MarkerArray, "kmpc/markers"),
            (DiagnosticArray, "/diagnostics"),
        ):
            node.create_subscription(kind, name, lambda m, n=name: heard.update({n: m}), 10)
        goals = node.create_publisher(PoseStamped, "goal_pose", 10)
        assert spin(node, lambda: goals.get_subscription_count() and "kmpc/markers" in heard)
        # without a goal others may command the robot
        before = drive.robot.commands
        spin(node, lambda: False, 0.5)
        assert drive.robot.commands == before
        goal = PoseStamped()
        goal.header.frame_id, goal.pose.orientation.w = "map", 1.0
        goal.pose.position.x = 1.5
        goals.publish(goal)
        assert spin(node, lambda: drive.robot.pose[0] > 0.25 and "kmpc/plan" in heard)
        assert heard["kmpc/plan"].header.frame_id == "map"
        kinds = [marker.type for marker in heard["kmpc/markers"].markers]
        assert kinds[:3] == [3, 9, 0] and len(kinds) == 23
        # odometry stops: so does the robot, and goes on by itself
        drive.robot.silent = {"odom"}
        assert spin(node, lambda: drive.robot.stopped, 5.0)
        there = drive.robot.pose[0]
        assert there < 0.9
        drive.robot.silent = set()
        assert spin(node, lambda: drive.robot.pose[0] > there + 0.1)
        # it jumps: the gate stops the robot, which is somewhere else
        x, y, theta = drive.robot.pose
        drive.robot.put(x - 0.6, y + 0.3, theta)
        assert spin(node, lambda: drive.robot.stopped, 5.0)
        held = "the goal is held"
        assert spin(node, lambda: heard["/diagnostics"].status[0].message == held), heard
        assert math.dist(drive.robot.pose[:2], (1.5, 0.0)) < 0.05
        values = {pair.key for pair in heard["/diagnostics"].status[0].values}
        assert values >= {"gate", "messages", "errors"}
        enable = node.create_client(SetBool, "kmpc/enable")
        assert enable.wait_for_service(10.0)
        enable.call_async(SetBool.Request(data=False))
        report = drive.report()
        assert report["outcome"].startswith("arrived"), report


def test_who_is_killed_and_who_is_ended_leaves_a_robot_that_stands(tmp_path, monkeypatch) -> None:
    course = short_course(circles=(), goal=(1.9, 0.0, 0.0))
    ros = "--goal 1.9 0 0 --ros-args -p maps:=''"
    for number in (signal.SIGKILL, signal.SIGINT):
        with Drive(tmp_path, monkeypatch, ros, course) as drive:
            drive.wait_for(lambda: drive.robot.pose[0] > 0.2, "it does not drive")
            drive.end(number)
            assert until(lambda: drive.robot.stopped, 5.0)
            if number is signal.SIGINT:
                report = drive.report()
                assert report["status"] == 130 and "SIGINT" in report["outcome"]


def test_the_path_of_another_planner_is_followed(tmp_path, monkeypatch, others) -> None:
    from geometry_msgs.msg import PoseStamped
    from nav_msgs.msg import Path

    course = short_course(circles=(kl.Circle(0.5, 0.03, 0.06),), goal=(1.0, 0.0, 0.0))
    ros = "--ros-args -p maps:='' -p follow_plan:=true"
    with Drive(tmp_path, monkeypatch, ros, course) as drive:
        node, sides = others(drive), []
        plans = node.create_publisher(Path, "plan", 1)
        assert spin(node, lambda: plans.get_subscription_count())
        path = Path()
        path.header.frame_id = "map"
        for k in range(41):  # round the far side, which is the longer one
            pose = PoseStamped()
            pose.pose.position.x = k / 40
            pose.pose.position.y = 0.45 * math.sin(math.pi * k / 40)
            pose.pose.orientation.w = 1.0
            path.poses.append(pose)
        plans.publish(path)

        def there() -> bool:
            sides.append(drive.robot.pose[1])
            return math.dist(drive.robot.pose[:2], (1.0, 0.0)) < 0.05

        assert spin(node, there), drive.robot.pose
        assert max(sides) > 0.3 and drive.robot.clearance > 0.0
        drive.end()
        assert drive.report()["loop"]["errors"] == 0
