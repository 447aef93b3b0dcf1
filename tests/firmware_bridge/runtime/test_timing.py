"""When ticks, plans and commands come, also after a stall, and how their times are counted."""

import math

import pytest
from loop_bench import TICK, Bench

from firmware_bridge.runtime.timing import Deadlines, Histogram, table
from firmware_bridge.safety.gate_table import GateState


@pytest.mark.parametrize("command_period", [0.02, 0.1])
def test_observers_learn_when_a_plan_goes_out_for_the_first_time(command_period):
    seen = []

    class Watch:
        def on_tick(self, now, state, output, sent, fresh):
            seen.append((round(now, 3), output.state, sent, fresh))

    bench = Bench(observers=(Watch(),), command_period=command_period).drive()
    planned = bench.plan_at
    bench.run(1.0)
    fresh = [now for now, _, _, first in seen if first]
    active = [now for now, state, _, _ in seen if state is GateState.ACTIVE]
    # each plan once, in the tick after it was made; the plan that was there before the gate opened
    # is not new
    assert [round(math.remainder(now - planned, 0.1), 6) for now in fresh] == [0.0] * len(fresh)
    assert len(fresh) >= 20 and all(
        b - a == pytest.approx(0.1) for a, b in zip(fresh, fresh[1:], strict=False)
    )
    assert active[0] <= fresh[0] <= active[0] + 0.1 and all(
        sent for _, _, sent, first in seen if first
    )


def test_a_new_plan_goes_out_in_the_next_tick_even_where_commands_are_as_rare_as_plans():
    bench = Bench(command_period=0.1).drive()
    bench.run(0.05)  # so that plans and the commands' period are out of step
    planned = bench.planner.latest
    count = len(bench.driver.sent)
    while bench.planner.latest is planned:
        bench.run(TICK)
    assert (
        len(bench.driver.sent) == count + 1
        and bench.driver.sent[-1][0] - bench.planner.latest[0].stamp <= TICK
    )
    bench.controller = None  # fails from now on: the last command is repeated until it is too old
    bench.run(0.2)
    assert len(bench.driver.sent) == count + 2


def test_commands_go_out_at_their_own_period_and_stops_at_every_tick():
    bench = Bench(command_period=0.1).drive()
    count = len(bench.driver.sent)
    bench.run(2.0)
    times = [t for t, _, _ in bench.driver.sent[count:]]
    assert len(times) == 20 and all(
        b - a == pytest.approx(0.1) for a, b in zip(times, times[1:], strict=False)
    )
    bench.driver.go_silent()
    bench.run(1.0)
    stopping = [c for c in bench.driver.sent if c[0] > bench.driver.silent_since + 0.26]
    assert all(
        b[0] - a[0] == pytest.approx(TICK) for a, b in zip(stopping, stopping[1:], strict=False)
    )
    assert stopping[0][0] - bench.driver.silent_since <= 0.3 and stopping[0][1] < 0.3


def test_after_a_stall_ticks_are_skipped_and_do_not_burst():
    bench = Bench()
    bench.planner.start = lambda: None
    times, plain = [], bench.loop.tick

    def tick(now):
        times.append(now)
        if len(times) == 50:
            bench.clock.now += 1.005
        if len(times) == 100:
            bench.loop.request_stop("test")
        return plain(now)

    bench.loop.tick = tick
    bench.gate.enable()
    bench.loop.run()
    gaps = [b - a for a, b in zip(times, times[1:], strict=False)]
    assert sum(g > 1.0 for g in gaps) == 1
    assert all(g >= TICK - 1e-6 or g == pytest.approx(0.015) for g in gaps)
    assert bench.loop.statistics.skipped == 50
    assert all(
        (t - times[0]) / TICK == pytest.approx(round((t - times[0]) / TICK), abs=1e-6)
        for t in times
    )


def test_deadlines_neither_drift_nor_burst():
    deadlines = Deadlines(0.1, 5.0)
    assert deadlines.next == 5.0
    deadlines.advance(5.03)
    assert deadlines.next == pytest.approx(5.1)
    deadlines.advance(5.45)
    assert deadlines.next == pytest.approx(5.5) and deadlines.skipped == 3
    deadlines.advance(5.2)  # woken early: still one step on
    assert deadlines.next == pytest.approx(5.6) and deadlines.skipped == 3


def test_quantiles_are_right_to_a_percent_and_memory_does_not_grow():
    times = Histogram()
    size = len(times._bins)
    for k in range(1, 100_001):
        times.add(k * 1e-5)
    for share in (0.5, 0.99, 0.999):
        assert times.quantile(share) == pytest.approx(share, rel=0.01)
    assert times.maximum == 1.0 and times.count == 100_000 and len(times._bins) == size
    assert times.share_above(0.9) == pytest.approx(0.1, abs=0.01) and times.share_above(2.0) == 0.0
    times.add(math.nan)
    assert times.count == 100_000
    for extreme in (0.0, 1e-9, 1e9):
        times.add(extreme)
    assert times.quantile(0.0) <= 1e-6 and times.maximum == 1e9
    assert Histogram().summary()["p50"] is None and "-" in table({"none": Histogram()})
