"""The emulated rover moves as the real one was measured to."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_bridge.emulator.rover.physics import Demand, DriveLimits, RoverPhysics

LIMITS = DriveLimits(1.0, math.radians(120.0), math.radians(120.0))
DT = 0.02


def run(physics: RoverPhysics, demand: Demand, seconds: float) -> np.ndarray:
    """Forward speed and turn rate after each period."""
    rows = []
    for _ in range(round(seconds / DT)):
        heading = physics.pose[2]
        physics.step(demand, LIMITS, DT)
        east, north, turn = physics.velocity
        middle = heading + 0.5 * DT * turn
        rows.append((east * math.cos(middle) + north * math.sin(middle), turn))
    return np.array(rows)


def first_at(values: np.ndarray, level: float) -> float:
    """When a row of period means first reaches a level [s]."""
    return (int(np.argmax(values >= level)) + 0.5) * DT


def test_speed_has_the_measured_lag_and_overshoot() -> None:
    speeds = run(RoverPhysics(), Demand(0.5), 6.0)[:, 0]
    assert first_at(speeds, 0.45) == pytest.approx(0.69, abs=DT)
    assert speeds.max() == pytest.approx(0.541, abs=0.002)
    assert speeds[-50:] == pytest.approx(0.5, abs=0.001)


def test_turn_rate_has_the_measured_lag() -> None:
    turns = run(RoverPhysics(), Demand(0.5, 0.3), 3.0)[:, 1]
    assert first_at(turns, 0.27) == pytest.approx(0.17, abs=DT)
    assert turns[-50:] == pytest.approx(0.3, abs=0.001)


def test_reverse_mirrors_forward_and_left_mirrors_right() -> None:
    forward, mirrored = (
        run(RoverPhysics(), Demand(0.5, 0.4), 2.0),
        run(RoverPhysics(), Demand(-0.5, -0.4), 2.0),
    )
    assert mirrored == pytest.approx(-forward, abs=1e-12)


def test_braking_takes_the_measured_distance() -> None:
    physics = RoverPhysics()
    run(physics, Demand(0.5), 6.0)
    start = physics.pose[0]
    speeds = run(physics, Demand(), 2.0)[:, 0]
    assert physics.pose[0] - start == pytest.approx(0.2, abs=0.01)
    assert physics.stopped
    assert speeds.min() >= 0.0, "a brake does not reverse"


def test_turns_no_faster_than_allowed() -> None:
    turns = run(RoverPhysics(), Demand(0.0, 10.0), 3.0)[:, 1]
    assert turns.max() <= math.radians(120.0) + 1e-9
    assert np.diff(turns).max() <= math.radians(120.0) * DT + 1e-9


def test_the_floor_slips_as_asked_and_the_same_for_the_same_seed() -> None:
    def far(slip: float, seed: int, gain: float = 1.0) -> tuple[float, float, float]:
        physics = RoverPhysics(slip, gain, seed)
        run(physics, Demand(0.5, 0.2), 10.0)
        return physics.pose

    assert far(0.0, 1) == far(0.0, 2)
    assert far(0.1, 1) == far(0.1, 1)
    assert far(0.1, 1) != far(0.1, 2)
    assert far(0.0, 0, 0.5)[2] == pytest.approx(0.5 * far(0.0, 0)[2])
    assert far(0.1, 1)[2] == pytest.approx(1.1 * far(0.0, 1)[2], rel=0.03), (
        "the slip's mean is in the heading"
    )


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.one_of(st.none(), st.floats(-3.0, 3.0)), st.floats(-5.0, 5.0), st.integers(1, 50)
        ),
        max_size=8,
    )
)
def test_stays_finite_and_within_reach_whatever_is_asked(
    demands: list[tuple[float | None, float, int]],
) -> None:
    physics = RoverPhysics()
    for speed, turn, periods in demands:
        for _ in range(periods):
            physics.step(Demand(speed, turn), LIMITS, DT)
            assert all(map(math.isfinite, (*physics.pose, *physics.velocity)))
            assert math.hypot(*physics.velocity[:2]) < 1.25 * 3.0
