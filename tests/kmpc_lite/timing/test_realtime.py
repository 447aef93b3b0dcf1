import gc
import os

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.realtime import DeadlineLoop, Histogram, prepare_process


class FakeTime:
    """A clock that only moves when somebody sleeps or works."""

    def __init__(self) -> None:
        self.now = 100.0

    def clock(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        assert seconds > 0
        self.now += seconds


@pytest.mark.parametrize("percent", [1, 50, 90, 99, 99.9])
def test_percentiles_are_within_the_bins_width(percent: float) -> None:
    times = np.random.default_rng(0).lognormal(-7.0, 1.0, 20_000)
    histogram = Histogram()
    for seconds in times:
        histogram.add(float(seconds))
    exact = np.quantile(times, percent / 100, method="inverted_cdf")
    assert histogram.percentile(percent) == pytest.approx(exact, rel=0.012)
    assert histogram.count == len(times)
    assert histogram.largest == times.max() == histogram.percentile(100)


def test_histogram_of_nothing_and_of_extremes() -> None:
    histogram = Histogram()
    assert np.isnan(histogram.percentile(50)) and histogram.share_above(0.0) == 0.0
    for seconds in (0.0, -1.0, 1e-12, 1e6):
        histogram.add(seconds)
    assert histogram.count == histogram.counts.sum() == 4
    assert histogram.percentile(50) <= 1.1e-7 and histogram.largest == 1e6


def test_deadlines_are_absolute() -> None:
    time = FakeTime()
    loop = DeadlineLoop(0.01, time.clock, time.sleep)
    begun = []
    for _ in loop.ticks(1.0):
        begun.append(time.now)
        time.now += 0.004  # work: must not move the next deadline
    assert len(begun) == 100
    np.testing.assert_allclose(begun, 100.0 + 0.01 * np.arange(100), atol=1e-9)
    assert loop.skipped == 0 and loop.lateness.largest < 1e-9


def test_a_stall_is_skipped_not_made_up_for() -> None:
    time = FakeTime()
    loop = DeadlineLoop(0.1, time.clock, time.sleep)
    begun, ticks = [], []
    for tick in loop.ticks(2.0):
        ticks.append(tick)
        begun.append(round(time.now - 100.0, 9))
        if tick.index == 3:
            time.now += 0.537
    assert begun[:4] == [0.0, 0.1, 0.2, 0.3]
    # 0.837 is late for 0.8; 0.4 to 0.7 are lost, and from 0.9 on all is as before
    assert begun[4] == pytest.approx(0.837) and ticks[4].index == 8 and ticks[4].skipped == 4
    assert ticks[4].late == pytest.approx(0.037)
    np.testing.assert_allclose(begun[5:], np.arange(9, 20) / 10)
    assert loop.skipped == 4 and np.diff(begun).min() > 0.06


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan"), float("inf")])
def test_a_period_that_is_none_is_refused(period: float) -> None:
    with pytest.raises(kl.ProblemError, match="period"):
        DeadlineLoop(period)


def test_preparing_a_process_tells_what_was_not_permitted(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError("not you")

    monkeypatch.setattr(os, "sched_setaffinity", refuse)
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    try:
        told = "\n".join(prepare_process(cpu=0))
    finally:
        gc.unfreeze()
    assert "not pinned" in told and "not permitted (not you)" in told and "not limited" in told
