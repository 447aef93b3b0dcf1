"""What the planner tells the controller of the past period: the mean of what was on the wire."""

import pytest
from robots import Clock, FakeDriver

from firmware_bridge.messages import State, VelocityCommand
from firmware_bridge.runtime.controller_thread import Planner, SentCommands


def ramp(until: float, tick: float = 0.02) -> SentCommands:
    """Commands of a gate that lets the speed grow by 1 m/s^2 and the turn by 2 rad/s^2."""
    sent = SentCommands()
    for k in range(round(until / tick)):
        sent.add(k * tick, k * tick, 2.0 * k * tick)
    return sent


def test_the_mean_is_weighed_by_time() -> None:
    sent = SentCommands()
    sent.add(0.0, 1.0, 0.0)
    sent.add(0.25, 3.0, 1.0)
    assert sent.mean(0.0, 1.0) == pytest.approx((2.5, 0.75, 0.0))
    assert sent.mean(0.25, 1.0) == pytest.approx((3.0, 1.0, 0.0))
    assert sent.mean(0.1, 0.2) == pytest.approx((1.0, 0.0, 0.0))
    v, omega, _ = ramp(1.0).mean(0.5, 0.6)  # type: ignore[misc]
    assert (v, omega) == pytest.approx((0.54, 1.08))


def test_a_plan_is_for_the_moment_at_which_it_is_ready():
    """On a busy computer a step took 125 ms, and a wall was touched: the plan was for its start."""
    clock = Clock()
    driver = FakeDriver(clock)
    asked = []

    def slow(state):
        asked.append(state)
        clock.now += 0.08
        return VelocityCommand(0.5, 0.0, clock())

    planner = Planner(slow, driver.state, 0.1, clock=clock)
    for _ in range(30):
        driver.send(0.5, 0.0)
        planner.sent.add(clock(), 0.5, 0.0)
        began = clock()
        planner.step(began)
        clock.now += 0.02
    assert planner.lead == pytest.approx(0.08)
    assert asked[-1].stamp == pytest.approx(began + 0.08)
    truth = next(s for s in reversed(driver.path) if s.stamp <= began + 1e-9)
    assert asked[-1].x - truth.x == pytest.approx(0.5 * (asked[-1].stamp - truth.stamp), abs=1e-6)


def test_what_comes_after_a_plan_delays_no_command() -> None:
    order: list[str] = []
    planner = Planner(
        lambda state: VelocityCommand(0.5, 0.0, 0.0),
        lambda: State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        0.1,
        clock=lambda: 0.0,
        after=lambda: order.append("later" if planner.latest is not None else "too early"),
    )
    planner.step(0.0)
    assert order == ["later"] and planner.errors == 0
