"""When ticks, plans and commands come, also after a stall, and how their times are counted."""

import math

import pytest
from loop_bench import TICK, Bench

from firmware_bridge.runtime.timing import Histogram, table


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
