"""Drives whose only link are ROS 2 topics: real bytes over a real session, on a clock of ours."""

from __future__ import annotations

import math

import pytest

pytest.importorskip("zenoh", reason="the extra ros2 (eclipse-zenoh) is not installed")

from topic_rig import TopicRig, short_course

from firmware_bridge.emulator.ros2.robot import EmulatedRobot
from firmware_bridge.safety.gate_table import GateState, Reason


def drive(rig: TopicRig, seconds: float = 20.0) -> float:
    """Drive until a goal is reached; how long it took [s]."""
    reached, began = rig.navigator.reached, rig.now
    while rig.navigator.reached == reached and rig.now - began < seconds:
        rig.tick()
    return rig.now - began


def test_a_drive_past_an_obstacle_that_only_a_map_topic_tells() -> None:
    with TopicRig(short_course(), EmulatedRobot(sees=("map",))) as rig:
        rig.drive_to(rig.scenario.goal)
        took = drive(rig)
        assert rig.navigator.reached == 1, rig.loop.why()
        assert math.dist(rig.emulator.pose[:2], rig.scenario.goal[:2]) < 0.05
        assert abs(math.remainder(rig.emulator.pose[2], math.tau)) < 0.15
        assert rig.clearance > 0.0
        assert took < 12.0
        # then others may command the robot
        sent = rig.driver.published
        rig.tick(60)
        assert rig.driver.published - sent <= 51
        assert rig.gate.state is GateState.ACTIVE


def test_a_robot_whose_peer_is_killed_stops_and_goes_on_after_its_return() -> None:
    with TopicRig(short_course(circles=()), EmulatedRobot(sees=("map",))) as rig:
        rig.drive_to(rig.scenario.goal)
        while rig.emulator.pose[0] < 0.2:
            rig.tick()
        assert rig.loop.snapshot.output.v > 0.3
        rig.kill()
        rig.tick(20)  # 0.4 s: the pose is too old
        assert Reason.POSE in rig.loop.snapshot.output.reasons
        rig.tick(35)  # the ramp
        assert rig.gate.state is GateState.HOLDING
        assert (rig.loop.snapshot.output.v, rig.loop.snapshot.output.omega) == (0.0, 0.0)
        rig.tick(150)
        rig.revive()
        drive(rig)
        assert rig.navigator.reached == 1, rig.loop.why()


def test_a_robot_that_waited_too_long_drives_again_when_somebody_sends_a_goal() -> None:
    with TopicRig(short_course(circles=()), EmulatedRobot(sees=("map",)), resume=1.5) as rig:
        rig.drive_to(rig.scenario.goal)
        rig.tick(60)
        rig.kill()
        rig.tick(200)
        assert rig.gate.state is GateState.RELEASED
        rig.revive()
        rig.tick(50)
        assert rig.gate.state is GateState.RELEASED
        rig.drive_to(rig.scenario.goal)
        drive(rig)
        assert rig.navigator.reached == 1


def test_a_drive_past_an_obstacle_that_only_a_scan_topic_tells() -> None:
    with TopicRig(short_course(), EmulatedRobot(sees=("scan",))) as rig:
        rig.drive_to(rig.scenario.goal)
        drive(rig)
        assert rig.navigator.reached == 1, (rig.loop.why(), rig.planner.last_error)
        assert rig.clearance > 0.0
