"""What a run is told to be: an end in any case, touches, and goals that are left again."""

import math
from dataclasses import replace

import pytest
from robots import Clock

from firmware_bridge.messages import State
from firmware_bridge.runtime.navigator import Moment, Navigator, Planned, Task


def navigator(
    clock, *, gap_at=None, circles=(), wait=None, seconds=20.0, settle=0.5, command=(0.0, 0.0)
):
    task = Task((1.0, 0.0, 0.0), 0.05, 0.1, 0.2, lambda t: list(circles), gap_at)

    def step(pose, circles, moment):
        return Planned(*(command(pose) if callable(command) else command), "SOLVED")

    return Navigator(step, task, settle, seconds, clock, wait)


def at(made, clock, x, y=0.0, theta=0.0, after=0.1, driving=True):
    clock.now += after
    made(State(x, y, theta, 0.0, 0.0, clock()), Moment(driving))


def test_a_vehicle_that_is_never_given_ends_the_run():
    """The run waited for ever: the time counted from the first command only."""
    clock = Clock()
    made = navigator(clock)
    assert not made.finished()
    at(made, clock, 0.0, after=19.0, driving=False)
    assert not made.finished()
    clock.now += 2.0
    assert made.finished()
    assert not made.drove


def test_wait_is_counted_apart_from_the_drive():
    clock = Clock()
    made = navigator(clock, wait=60.0, seconds=5.0)
    assert not made.finished()
    at(made, clock, 0.0, after=50.0, driving=False)
    assert not made.finished()
    at(made, clock, 0.0)
    at(made, clock, 0.1, after=4.0)
    assert not made.finished()
    clock.now += 2.0
    assert made.finished()
    assert made.drove


def test_a_robot_that_stands_inside_an_obstacle_is_not_driven_and_says_so():
    """It drove, from inside a wall, for all its time: the frame's origin was wrong."""
    clock, task = Clock(), Task((1.0, 0.0, 0.0), 0.05, 0.1, 0.2, lambda t: [])
    task = replace(task, misplaced=lambda pose: "stands inside" if pose[0] < 0.5 else "")
    made = Navigator(lambda *_: Planned(0.3, 0.0, "SOLVED"), task, 0.5, 20.0, clock)
    state = State(0.0, 0.0, 0.0, 0.0, 0.0, clock())
    assert made(state, Moment()).v == 0.0
    assert not made.refused  # it may still be carried
    assert made(state, Moment(driving=True)).v == 0.0
    assert made.refused == made.reason == "stands inside"
    assert not made.drove
    assert made(replace(state, x=1.0), Moment(driving=True)).v == 0.0, "for good"

    made = Navigator(lambda *_: Planned(0.3, 0.0, "SOLVED"), task, 0.5, 20.0, clock)
    made(state, Moment())
    made(replace(state, x=1.0), Moment())
    assert made(replace(state, x=0.9), Moment(driving=True)).v == 0.3
    made(state, Moment(driving=True))
    assert not made.refused, "a robot that has touched on its way is judged otherwise"


def test_clearance_is_that_to_whatever_the_scenario_holds():
    clock = Clock()
    made = navigator(clock, gap_at=lambda pose, t: 0.5 - pose[1] - 0.2)
    at(made, clock, 0.0)
    at(made, clock, 0.1, 0.1)
    assert made.clearance == pytest.approx(0.2)
    assert not made.touched
    at(made, clock, 0.1, 0.31)
    assert made.touched
    assert made.report()["touched"] is True


def test_a_touch_between_two_poses_is_one():
    clock = Clock()
    made = navigator(clock, circles=[(0.5, 0.0, 0.1)])
    at(made, clock, 0.15, 0.25)
    at(made, clock, 0.85, 0.25)
    assert made.touched
    assert made.clearance == pytest.approx(math.hypot(0.0, 0.25) - 0.3, abs=0.01)


def test_only_a_robot_that_stays_has_arrived():
    clock = Clock()
    made = navigator(clock)
    for _ in range(8):
        at(made, clock, 1.02)
    assert made.finished()
    assert made.arrived
    made.look(State(1.08, 0.0, 0.0, 0.0, 0.0, clock()))
    assert made.arrived_after is not None
    assert not made.arrived
    assert made.report()["arrived"] is False
    made.look(None)
    made.look(State(1.04, 0.0, 0.0, 0.0, 0.0, clock()))
    assert made.arrived


@pytest.mark.parametrize("command", [(0.1, 0.0), (-0.1, 0.0), (0.0, 0.2), (0.0, -0.2)])
def test_a_robot_that_moves_within_its_tolerances_has_not_arrived(command):
    """It was stopped there, and left its goal again while it braked."""
    clock = Clock()
    made = navigator(clock, command=command)
    for _ in range(30):
        at(made, clock, 1.02)
    assert made.stays
    assert not made.finished()
    assert not made.arrived


def test_a_robot_that_stops_at_its_goal_has_arrived_from_then_on():
    clock = Clock()
    made = navigator(clock, command=lambda pose: (0.3 if pose[0] < 1.0 else 0.0, 0.0))
    for x in (0.9, 0.96, 0.99, 1.0, 1.01, 1.02, *[1.02] * 5):
        at(made, clock, x)
        finished = made.finished()
    assert finished
    assert made.arrived
    assert made.arrived_after == pytest.approx(0.4)  # at 1.01: the command before was the first 0


def test_the_planner_is_told_the_moment_and_its_scan_is_kept_for_who_looks_on():
    told = []
    task = Task((1.0, 0.0, 0.0), 0.05, 0.1, 0.2, lambda t: [])

    def step(pose, circles, moment):
        told.append(moment)
        return Planned(0.1, 0.0, "SOLVED", "its way is barred" if moment.scan else "")

    made = Navigator(step, task, 0.5, 20.0, Clock())
    moments = [Moment(True, (0.2, 0.1), "scan"), Moment(True)]
    for moment in moments:
        made(State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), moment)
        assert made.scan is moment.scan
        assert made.reason == ("its way is barred" if moment.scan else "")
    assert told == moments


def test_the_goal_must_be_held_with_its_heading_until_time_is_up():
    clock = Clock()
    made = navigator(clock, command=(0.04, 0.0), seconds=2.0)  # so slow that it counts as standing
    assert made.report()["position_error_m"] is None
    for x in (0.0, 0.96, 0.96, 0.90, 0.96, 0.97, 1.0, 1.0, 1.0):
        at(made, clock, x)
        assert not made.finished(), x
    at(made, clock, 1.0)
    assert made.finished() and made.report()["arrived_after_s"] == 0.4
    made = navigator(clock, command=(0.04, 0.0), seconds=2.0)
    for _ in range(20):
        at(made, clock, 1.0, theta=0.2 + math.tau)
        assert not made.finished()
    clock.now += 0.2
    assert made.finished() and not made.arrived and made.report()["heading_error_rad"] == 0.2


def test_the_clearance_is_to_where_moving_obstacles_are():
    clock = Clock()
    task = Task((1.0, 0.0, 0.0), 0.05, 0.1, 0.2, lambda t: [[0.5, 1.0 - 0.1 * t, 0.3]])
    made = Navigator(lambda *_: Planned(0.0, 0.0, "SOLVED"), task, 0.5, 20.0, clock)
    for _ in range(3):
        at(made, clock, 0.5, after=1.0)
    assert made.report()["clearance_m"] == round(0.8 - 0.3 - 0.2, 4)
