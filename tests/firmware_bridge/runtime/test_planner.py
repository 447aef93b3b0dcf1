"""The pose that a controller is given: as it will be when its command acts."""

import math

import pytest
from loop_bench import Bench

from firmware_bridge.messages import State, VelocityCommand
from firmware_bridge.runtime.controller_thread import SentCommands, unicycle_arc


def test_unicycle_arc_is_the_limit_of_small_steps():
    state = State(0.3, -0.2, 0.7, 0.0, 0.0, 5.0)
    for v, omega in ((0.5, 0.0), (0.5, 1e-9), (0.5, 2.0), (-0.4, -1.3), (0.0, 3.0)):
        end, x, y, theta = unicycle_arc(state, v, omega, 0.8), state.x, state.y, state.theta
        n = 20_000
        for _ in range(n):
            middle = theta + 0.4 * omega / n
            x, y, theta = (
                x + 0.8 * v / n * math.cos(middle),
                y + 0.8 * v / n * math.sin(middle),
                theta + 0.8 * omega / n,
            )
        assert (end.x, end.y, end.theta, end.stamp) == pytest.approx((x, y, theta, 5.8), abs=1e-8)


def test_a_state_is_carried_along_what_was_sent_since():
    sent = SentCommands()
    state = State(1.0, 2.0, 0.5, 0.1, 0.0, 10.0)
    assert sent.carry(state, 9.0) == state and sent.carry(state, 10.0) == state
    assert sent.carry(state, 10.5) == unicycle_arc(state, 0.1, 0.0, 0.5)
    for command in ((9.5, 0.2, 0.3), (10.1, 0.4, -0.3), (10.3, 0.5, 0.1)):
        sent.add(*command)
    by_hand = unicycle_arc(
        unicycle_arc(unicycle_arc(state, 0.2, 0.3, 0.1), 0.4, -0.3, 0.2), 0.5, 0.1, 0.1
    )
    carried = sent.carry(state, 10.4)
    assert (carried.x, carried.y, carried.theta) == pytest.approx(
        (by_hand.x, by_hand.y, by_hand.theta), abs=1e-12
    )


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


def test_the_age_of_an_output_counts_from_the_beginning_of_its_computation():
    def slow(state):
        bench.clock.now += 0.24
        return VelocityCommand(0.3, 0.0, bench.clock())

    bench = Bench(slow)
    start = bench.clock()
    bench.planner.step(start)
    assert bench.planner.latest[0].stamp == start


def test_the_controller_is_not_asked_without_a_usable_pose():
    bench = Bench().drive()
    asked = []
    bench.controller = lambda state: asked.append(state) or VelocityCommand(0.0, 0.0, bench.clock())
    bench.driver.go_silent()
    bench.run(2.0)
    assert len(asked) <= 6
    assert all(s.stamp - bench.driver.silent_since <= 0.51 for s in asked)
