"""The pose that a controller is given: as it will be when its command acts."""

import math

import pytest
from loop_bench import Bench

from firmware_bridge.messages import VelocityCommand


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
