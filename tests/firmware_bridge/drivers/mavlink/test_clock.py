"""TIMESYNC and time_boot_ms."""

import random

import pytest

from firmware_bridge.drivers.mavlink.clock import VehicleClock

OFFSET = 1234.5


def sync(
    clock: VehicleClock,
    now: float,
    there: float = 0.005,
    back: float = 0.005,
    offset: float = OFFSET,
) -> bool:
    """One round trip that starts at `now`."""
    ts1 = clock.ask(now)
    return clock.answer(int((now + there + offset) * 1e9), ts1, now + there + back)


def test_the_error_is_at_most_half_of_the_best_round_trip() -> None:
    noise, clock = random.Random(2), VehicleClock()
    for i in range(200):
        sync(clock, 10.0 + i, noise.expovariate(100.0), noise.expovariate(100.0))
        assert clock.best is not None
        assert abs(clock.best.offset - OFFSET) <= clock.best.duration / 2.0 + 1e-9
    assert clock.jumps == 0


def test_a_reboot_is_noticed_at_once() -> None:
    clock = VehicleClock()
    sync(clock, 10.0)
    clock.stamp(round((11.0 + OFFSET) * 1000), 11.0)
    assert clock.stamp(2000, 12.0) == 12.0
    assert clock.jumps == 1
    sync(clock, 12.0, offset=-10.0)
    assert clock.stamp(2500, 12.6) == pytest.approx(12.5)


def test_answers_without_a_question_or_too_late_are_refused() -> None:
    clock = VehicleClock()
    assert not clock.answer(10**9, 77, 1.0)
    assert not sync(clock, 10.0, 0.4, 0.4)
    ts1 = clock.ask(20.0)
    assert clock.answer(int((20.005 + OFFSET) * 1e9), ts1, 20.01)
    assert not clock.answer(int((20.005 + OFFSET) * 1e9), ts1, 20.01)
    assert clock.jumps == 0
