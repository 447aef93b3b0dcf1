"""Routes: the next goal is given when the last one is held."""

import pytest
from robots import Clock

from firmware_bridge.messages import State
from firmware_bridge.runtime.navigator import Moment, Navigator, Planned, Route, Task

GOALS = ((1.0, 0.0, 0.0), (1.0, 1.0, 1.5), (0.0, 0.0, 0.0))


@pytest.mark.parametrize("loop", [False, True])
def test_a_navigator_goes_on_only_when_a_goal_is_held(loop: bool) -> None:
    clock, route = Clock(), Route(GOALS, loop)
    task = Task(GOALS[-1], 0.05, 0.1, 0.2, lambda t: [], route=route)
    made = Navigator(lambda *_: Planned(0.0, 0.0, "SOLVED"), task, 0.5, 60.0, clock)

    def stand(pose, seconds):
        for _ in range(round(seconds / 0.1)):
            clock.now += 0.1
            made(State(*pose, 0.0, 0.0, clock()), Moment(driving=True))

    stand(GOALS[0], 0.4)
    assert route.leg == (1, 3), "it only passes"
    stand((0.5, 0.5, 0.0), 0.4)
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
    driving = Moment(driving=True)

    def stand(x: float) -> bool:
        for _ in range(10):
            clock.now += 0.1
            made(State(x, 0.0, 0.0, 0.0, 0.0, clock.now), driving)
        return made.arrived

    assert route.idle and not stand(1.0), "no goal is given yet, wherever it stands"
    made.go((2.0, 0.0, 0.0))
    assert not stand(1.0) and not route.idle and route.goal == (2.0, 0.0, 0.0)
    assert stand(2.0) and not made.finished()
    made.go((1.0, 0.0, 0.0))
    assert not stand(2.0) and stand(1.0) and not made.finished()
    clock.now += 20.0
    assert made.finished()
