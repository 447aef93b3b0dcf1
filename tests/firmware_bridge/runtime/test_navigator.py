"""What becomes of a run: an end in any case, touches, and goals that are left again."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from robots import Clock

from firmware_bridge.messages import State
from firmware_bridge.runtime.navigator import Moment, Navigator, Planned, Route, Task


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


def test_only_a_robot_that_stays_has_arrived():
    clock = Clock()
    made = navigator(clock)
    for k in range(8):  # an EKF's estimate goes on for a while after the stop
        at(made, clock, 1.0 + 0.009 * k)
        assert not made.finished()
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


def test_the_goal_must_be_held_with_its_heading_until_time_is_up():
    clock = Clock()
    made = navigator(clock, command=(0.03, 0.0), seconds=2.0)  # from 0.96 it may leave again
    assert made.report()["position_error_m"] is None
    for x in (0.0, 0.985, 0.985, 0.96, 0.985, 0.99, 1.0, 1.0, 1.0):
        at(made, clock, x)
        assert not made.finished(), x
    at(made, clock, 1.0)
    assert made.finished() and made.report()["arrived_after_s"] == 0.4
    made = navigator(clock, command=(0.03, 0.0), seconds=2.0)
    for _ in range(20):
        at(made, clock, 1.0, theta=0.2 + math.tau)
        assert not made.finished()
    clock.now += 0.2
    assert made.finished() and not made.arrived and made.report()["heading_error_rad"] == 0.2


GOALS = ((1.0, 0.0, 0.0), (1.0, 1.0, 1.5), (0.0, 0.0, 0.0))


@pytest.mark.parametrize("loop", [False, True])
def test_a_navigator_goes_on_only_when_a_goal_is_held(loop: bool) -> None:
    clock, route = Clock(), Route(GOALS, loop)
    task = Task(GOALS[-1], 0.05, 0.1, 0.2, lambda t: [], route=route)
    made = Navigator(lambda *_: Planned(0.0, 0.0, "SOLVED"), task, 0.5, 60.0, clock)

    def stand(pose, seconds):
        for _ in range(round(seconds / 0.1)):
            at(made, clock, *pose)

    for goal in (GOALS[0], (0.5, 0.5, 0.0)):
        stand(goal, 0.4)
        assert route.leg == (1, 3), "it only passes"
    stand(GOALS[0], 0.7)
    assert route.leg == (2, 3) and len(made.passed) == 1 and not made.arrived
    stand(GOALS[2], 1.0)
    assert route.leg == (2, 3), "a later goal does not count"
    stand(GOALS[1], 0.7)
    stand(GOALS[2], 0.7)
    assert made.finished() is made.arrived is not loop
    assert made.report()["route"] == {"goal": 1 if loop else 3, "of": 3, "held": 3}


def test_clicked_goals_are_driven_one_after_the_other_until_time_is_up() -> None:
    clock, route = Clock(), Route(GOALS[:1], clicked=True)
    task = Task(GOALS[0], 0.05, 0.1, 0.2, lambda t: [], route=route)
    made = Navigator(lambda *_: Planned(0.0, 0.0, "SOLVED"), task, 0.5, 20.0, clock)

    def stand(x: float) -> bool:
        for _ in range(10):
            at(made, clock, x)
        return made.arrived

    assert route.idle and not stand(1.0), "no goal is given yet, wherever it stands"
    made.go((2.0, 0.0, 0.0))
    assert not stand(1.0) and not route.idle and route.goal == (2.0, 0.0, 0.0)
    assert stand(2.0) and not made.finished()
    made.go((1.0, 0.0, 0.0))
    assert not stand(2.0) and stand(1.0) and not made.finished()
    clock.now += 20.0
    assert made.finished()
