"""Drives whose only link are ROS 2 topics: real bytes over a real session, on a clock of ours."""

import math
from typing import Any

import pytest
from waiting import until

pytest.importorskip("zenoh", reason="the extra ros2 (eclipse-zenoh) is not installed")

from topic_rig import TopicRig, short_course

import kmpc_lite as kl
from firmware_bridge.ros2.message_types import DIAGNOSTICS, LARGEST, MARKERS, PATH, TWIST
from firmware_bridge.ros2.names import Qos
from firmware_bridge.ros2.telling import Telling
from firmware_bridge.safety.gate_table import GateState, Reason
from firmware_bridge.wheels import Wheels
from kmpc_lab.emulator.ros2.robot import EmulatedRobot
from kmpc_lite.learn.formats.ackermann import ACKERMANN_STAMPED


def drive(rig: TopicRig, seconds: float = 20.0) -> float:
    """Drive until a goal is reached; how long it took [s]."""
    reached, began = rig.navigator.reached, rig.now
    while rig.navigator.reached == reached and rig.now - began < seconds:
        rig.tick()
    return rig.now - began


def test_a_drive_past_an_obstacle_that_only_a_map_topic_reports() -> None:
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
    with TopicRig(short_course(circles=()), EmulatedRobot(sees=("map",)), resume=2.0) as rig:
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
        rig.tick(50)
        rig.revive()
        rig.tick(60)
        assert rig.gate.state is GateState.ACTIVE
        # one that waited too long drives again when a goal is sent
        rig.kill()
        rig.tick(180)
        assert rig.gate.state is GateState.RELEASED
        rig.revive()
        rig.tick(40)
        assert rig.gate.state is GateState.RELEASED
        rig.drive_to(rig.scenario.goal)
        drive(rig)
        assert rig.navigator.reached == 1, rig.loop.why()


def test_a_drive_past_an_obstacle_that_only_a_scan_topic_reports() -> None:
    with TopicRig(short_course(), EmulatedRobot(sees=("scan",))) as rig:
        rig.drive_to(rig.scenario.goal)
        drive(rig)
        assert rig.navigator.reached == 1, (rig.loop.why(), rig.planner.last_error)
        assert rig.clearance > 0.0


STEERED = Wheels("car", wheelbase=0.3, steering_angle=math.atan(0.3 / 0.5))


@pytest.mark.parametrize("wheels", [STEERED, Wheels("car", turning_radius=0.5)])
def test_a_car_is_driven_by_steering_angles_or_by_turn_rates(wheels: Wheels) -> None:
    course = short_course(wheels=kl.Car(0.5), goal=(1.2, 0.3, 0.0))
    robot = EmulatedRobot(sees=("map",), wheelbase=wheels.wheelbase or 0.0)
    with TopicRig(course, robot, wheels=wheels) as rig:
        kinds = [seen.kind for seen in rig.driver.node.seen() if seen.topic == "/cmd_vel"]
        assert set(kinds) == {ACKERMANN_STAMPED if wheels.wheelbase else TWIST}
        rig.drive_to(rig.scenario.goal)
        drive(rig, 40.0)
        assert rig.navigator.reached == 1, rig.loop.why()
        assert math.dist(rig.emulator.pose[:2], rig.scenario.goal[:2]) < 0.05
        assert rig.clearance > 0.0 and rig.emulator.commands > 100


def test_a_car_that_listens_to_another_type_of_commands_is_reported() -> None:
    course = short_course(wheels=kl.Car(0.5))
    with TopicRig(course, EmulatedRobot(sees=("map",)), wheels=STEERED) as rig:
        telling = Telling(rig.driver, rig.navigator, rig.loop, 0.1, lambda: rig.now)
        told = f"/cmd_vel is heard as {TWIST}, expected {ACKERMANN_STAMPED}"
        assert until(lambda: telling._look() or told in telling.warnings())


def test_an_omni_is_driven_sideways_and_its_odometry_reports_so() -> None:
    course = short_course(wheels=kl.Omni(), goal=(0.3, 0.8, 0.0), circles=())
    with TopicRig(course, EmulatedRobot(sees=("map",)), wheels=Wheels("omni")) as rig:
        rig.drive_to(rig.scenario.goal)
        fastest = 0.0
        while not rig.navigator.reached and rig.now < 120.0:
            rig.tick()
            fastest = max(fastest, rig.driver.state().vy)
        assert rig.navigator.reached == 1, rig.loop.why()
        assert fastest > 0.2 and abs(rig.emulator.pose[2]) < 0.15


def test_garbage_on_every_topic_ends_nothing() -> None:
    garbage = (b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 200, bytes(range(256)), bytes(300))
    with TopicRig(short_course(circles=()), EmulatedRobot(sees=("map",))) as rig:
        rig.drive_to(rig.scenario.goal)
        began = rig.now
        while not rig.navigator.reached and rig.now - began < 20.0:
            rig.tick()
            for pair in rig.driver.subscriptions if rig.ticks % 10 == 0 else ():
                topic = pair[0].topic
                data = garbage[rig.ticks // 10 % len(garbage)]
                rig.emulator.node._session.put(topic.key(0), data)
                if rig.ticks == 50 and LARGEST[topic.kind] < 2**20:
                    rig.emulator.node._session.put(topic.key(0), bytes(LARGEST[topic.kind] + 1))
        assert rig.navigator.reached == 1, rig.loop.why()
        report = rig.loop.report()
        assert report["errors"] == report["controller_errors"] == 0
        counters = rig.driver.counters()
        assert counters["malformed"] > 20 and counters["errors"] == 0
        assert all("\n" not in text and len(text) < 250 for text in rig.driver.warnings())


def test_time_of_a_simulator_and_stamped_commands() -> None:
    robot = EmulatedRobot(sees=("map",), stamped=True, simulated_time=True)
    with TopicRig(short_course(circles=(), goal=(0.3, 0.0, 0.0)), robot) as rig:
        rig.drive_to(rig.scenario.goal)
        drive(rig)
        assert rig.navigator.reached == 1, rig.loop.why()
        assert rig.driver.inputs.clock_offset(rig.now) is None


def test_plan_markers_and_diagnostics_are_what_others_can_read() -> None:
    with TopicRig(short_course(circles=()), EmulatedRobot(sees=("map",))) as rig:
        telling = Telling(rig.driver, rig.navigator, rig.loop, 0.1, lambda: rig.now)
        kinds = {"kmpc/plan": PATH, "kmpc/markers": MARKERS, "/diagnostics": DIAGNOSTICS}
        heard = {
            name: rig.emulator.node.subscription(name, kind, Qos(depth=1))
            for name, kind in kinds.items()
        }
        rig.drive_to(rig.scenario.goal)
        rig.tick(50)
        messages: dict[str, Any] = {}

        def came() -> bool:
            telling.tell(diagnostics=True)
            for name, subscription in heard.items():
                if (taken := subscription.take()) is not None:
                    messages[name] = taken[0]
            return len(messages) == 3

        assert until(came), telling.last_error
        path, markers = messages["kmpc/plan"], messages["kmpc/markers"].markers
        assert path.header.frame_id == "map" and len(path.poses) == 21
        assert path.poses[-1].pose.position.x > path.poses[0].pose.position.x
        assert [marker.type for marker in markers] == [3, 9, 0]
        (status,) = messages["/diagnostics"].status
        assert status.level == 0 and {pair.key for pair in status.values} >= {"gate", "malformed"}
