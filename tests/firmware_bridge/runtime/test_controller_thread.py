"""What the planner tells the controller of the past period: the mean of what was on the wire."""

from __future__ import annotations

import math

import pytest
from loop_bench import Bench
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
    assert sent.mean(-0.5, 0.5) == pytest.approx((1.0, 0.25, 0.0)), "no plan moved it before"
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


@pytest.mark.parametrize("delay", [0.0, 0.04, 0.1, 0.2])
def test_the_controller_gets_the_pose_as_it_is_now_however_late_it_came(delay):
    seen = []

    def controller(state):
        truth = bench.driver.move()
        seen.append(
            math.hypot(state.x - truth.x, state.y - truth.y) + abs(state.theta - truth.theta)
        )
        assert state.stamp == pytest.approx(bench.clock())
        return VelocityCommand(
            0.3 * math.sin(bench.clock()), 0.5 * math.cos(2 * bench.clock()), bench.clock()
        )

    bench = Bench(controller, delay=delay)
    bench.drive()
    bench.run(5.0)
    assert len(seen) > 50 and max(seen) < 1e-9
    assert bench.planner.pose_age.quantile(0.5) == pytest.approx(delay, rel=0.02, abs=1e-5)


@pytest.mark.parametrize("latency", [0.04, 0.13, 0.3])
def test_dead_time_is_planned_for_from_the_pose_at_its_end(latency):
    expected = []

    def controller(state):
        assert state.stamp == pytest.approx(bench.clock() + latency)
        expected.append(state)
        return VelocityCommand(
            0.3 * math.sin(bench.clock()), 0.5 * math.cos(2 * bench.clock()), bench.clock()
        )

    bench = Bench(controller, delay=0.06, latency=latency)
    bench.drive()
    bench.run(5.0)
    by_stamp = {round(s.stamp, 6): s for s in bench.driver.path}
    errors = [
        math.hypot(truth.x - s.x, truth.y - s.y) + abs(truth.theta - s.theta)
        for s in expected[5:]
        if (truth := by_stamp.get(round(s.stamp, 6))) is not None
    ]
    assert len(errors) > 40 and max(errors) < 1e-9


def test_the_controller_is_not_asked_without_a_usable_pose():
    bench = Bench().drive()
    asked = []
    bench.controller = lambda state: asked.append(state) or VelocityCommand(0.0, 0.0, bench.clock())
    bench.driver.go_silent()
    bench.run(2.0)
    assert len(asked) <= 6
    assert all(s.stamp - bench.driver.silent_since <= 0.51 for s in asked)
