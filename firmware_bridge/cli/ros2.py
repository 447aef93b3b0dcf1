"""`kmpc ros2`: drive a robot whose link are ROS 2 topics, by a node of rclpy."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from firmware_bridge.cli.options import (
    add_course_options,
    add_limits,
    add_loop_options,
    overrides_of,
    people,
    prepare,
)
from firmware_bridge.integration.course import Course, beyond, course
from firmware_bridge.integration.recording import recorder_of, recording_to
from firmware_bridge.messages import BridgeError, ConfigError
from firmware_bridge.robot_file import SECTIONS, TOPICS, Robot, load_robot
from kmpc_lite.cli.command import Command, command_line, need, positive
from kmpc_lite.cli.options import add_clearance, add_goal_options, drive_overrides, split_settings

if TYPE_CHECKING:
    from firmware_bridge.ros2.driver import Ros2Driver

RESUME = 30.0
"""A robot whose odometry or scan is lost stands for so long, and goes on by itself when they come
back [s]; later a new goal is needed. safety.resume of a robot file says otherwise."""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what `run` reads."""
    add = parser.add_argument
    add("robot", nargs="?", help="robot file (TOML): limits, safety, control, wheels")
    add_limits(parser.add_argument_group("limits").add_argument)
    add_course_options(add)
    add_loop_options(add)
    add_goal_options(add, "in the frame of the parameter global_frame; else goal_pose is served")
    add_clearance(add)
    add("--radius", type=positive, metavar="R", help="of the robot [m] (default: the model's)")
    add("--seconds", type=positive, metavar="S", help="end after this time of driving [s]")
    add("--timeout", type=positive, default=10.0, metavar="S", help="to wait for odometry [s]")
    text = "ROS arguments, last: -p scans:=/front/scan -r cmd_vel:=/drive -r __ns:=/robot"
    add("--ros-args", nargs=argparse.REMAINDER, default=[], metavar="...", help=text)


def run(options: argparse.Namespace) -> int:
    """Serve goals until Ctrl-C, or drive to those of the command line."""
    need("without /opt/ros/$ROS_DISTRO/setup.bash sourced, kmpc ros2", "rclpy")
    options.set, tuning = split_settings(options.set, SECTIONS)
    overrides = drive_overrides(options, tuning)
    prepare(options)
    with ExitStack() as stack:
        driver, robot = stack.enter_context(_node(options))
        planner = None
        if driver.options.follow_plan:
            from firmware_bridge.ros2.geometry import GivenPath

            planner = GivenPath(lambda: driver.path, by_poses=robot.wheels.kind == "car")
        job = course(
            robot,
            options.settle,
            options.seconds,
            overrides=overrides,
            click=not overrides.goals,
            look=lambda moment: driver.obstacles(moment.stamp),
            planner=planner,
        )
        _serve(driver, job)
        name = stack.enter_context(recording_to(options.record))
        report, status = _drive(driver, job, name, options)
    if options.json:
        print(json.dumps(report))
    return status


def _drive(
    driver: Ros2Driver, job: Course, name: str | None, options: argparse.Namespace
) -> tuple[dict[str, Any], int]:
    from firmware_bridge.ros2.display import Display
    from firmware_bridge.runtime.drive import run as drive
    from firmware_bridge.runtime.session import Session

    @contextmanager
    def shown(session: Session) -> Iterator[None]:
        Display(driver, session, job)
        yield

    return drive(
        job.robot,
        job.navigator,
        job.period,
        (0.0, 0.0, 0.0),
        name,
        people(options),
        job.notes,
        watched=shown,
        recorder=recorder_of(job, command_line()),
        driver=driver,
    )


def _serve(driver: Ros2Driver, job: Course) -> None:
    """Let goals of topics reach the navigator, and others drive while there is none."""
    navigator = job.navigator
    clicked = navigator.route.clicked

    def take(goal: tuple[float, float, float]) -> str:
        refused = beyond(job.robot, goal) if clicked else "kmpc ros2 was given its goals already"
        if not refused:
            navigator.go(goal)
        return refused

    # the first step loads what it needs
    job.controller.step((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    job.controller.reset()
    route = navigator.route
    driver.serve(take, lambda: not (clicked and (route.idle or route.done)))


@contextmanager
def _node(options: argparse.Namespace) -> Iterator[tuple[Ros2Driver, Robot]]:
    """A node, not yet connected, and the robot that its parameters and the options describe."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    from firmware_bridge.ros2.driver import Ros2Driver
    from firmware_bridge.ros2.options import read_parameters

    try:
        rclpy.init(
            args=["--ros-args", *options.ros_args], signal_handler_options=SignalHandlerOptions.NO
        )
    except Exception as error:  # of rclpy's extension: it names the argument
        raise ConfigError(f"--ros-args: {str(error).splitlines()[0][:200]}") from error
    try:
        node = rclpy.create_node("kmpc", automatically_declare_parameters_from_overrides=True)
        given = {name: p.value for name, p in node.get_parameters_by_prefix("").items()}
        listened, keys = read_parameters(given)
        robot = _robot(options, keys)
        driver = Ros2Driver(node, listened, robot.wheels, robot.gate.scan_age)
        try:
            yield driver, robot
        finally:
            driver.close()
    finally:
        rclpy.shutdown()


def _robot(options: argparse.Namespace, keys: dict[str, dict[str, Any]]) -> Robot:
    """The robot file, under the node's parameters, under the options of the command line."""
    overrides = {name: dict(section) for name, section in keys.items()}
    for name, section in overrides_of(options).items():
        overrides.setdefault(name, {}).update(section)
    limits = overrides.get("limits", {})
    limits.setdefault("v_reverse", limits.get("v_max"))
    overrides["link"] = {"url": "topics", "driver": TOPICS, "timeout": options.timeout}
    robot = load_robot(options.robot, overrides)
    if robot.lidar is not None:
        raise ConfigError(f"{robot.where}: lidar: kmpc ros2 sees by the topics of `scans`")
    resume = robot.gate.resume if "resume" in robot.sections.get("safety", {}) else RESUME
    return replace(robot, gate=replace(robot.gate, resume=resume))


COMMAND = Command(
    text="Drive a robot of ROS 2 topics: a node of rclpy.",
    examples=(
        "kmpc ros2 --model robot.npz --v-max 0.3    # then RViz's 2D Goal Pose",
        "kmpc ros2 robot.toml --goal 1.5 1.5 0 --record monday",
        "kmpc ros2 --radius 0.2 --ros-args -p global_frame:=odom -p maps:='' -r odom:=/wheels/odom",
        "kmpc ros2 --ros-args --params-file robot.yaml -r __ns:=/robot1",
    ),
    add_options=add_options,
    run=run,
    errors=(BridgeError,),
)
