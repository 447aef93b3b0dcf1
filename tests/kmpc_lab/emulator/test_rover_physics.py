"""The emulated rover moves as the real one was measured to."""

import math

import numpy as np
import pytest

from kmpc_lab.emulator.rover.physics import Demand, DriveLimits, RoverPhysics

LIMITS = DriveLimits(1.0, 1.0, math.radians(120.0), math.radians(120.0))
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


TIMES = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.2, 1.5)
"""After a step [s]; what follows was recorded from ArduPilot Rover 4.6.3, skid-steered, with
ATC_ACCEL_MAX and ATC_DECEL_MAX 1: eight steps each, their spread 0.04 at the most."""
SPEED_UP = (0.05, 0.15, 0.30, 0.47, 0.67, 0.84, 1.01, 1.07, 1.09, 1.08)
SPEED_DOWN = (1.00, 0.89, 0.74, 0.56, 0.36, 0.20, 0.09, 0.04, 0.01, 0.00)
TURN_UP = (0.26, 0.66, 0.98, 1.02, 0.99, 1.01, 1.00, 1.00, 1.00, 1.00)
TURN_DOWN = (0.73, 0.33, 0.02, -0.02, 0.01, 0.00, 0.00, 0.00, 0.00, 0.00)
ENVELOPE = 0.06


def at_times(values: np.ndarray, scale: float) -> list[float]:
    """Shares of a step at `TIMES`, from means over periods."""
    ends = np.arange(1, len(values) + 1) * DT - 0.5 * DT
    return list(np.interp(TIMES, ends, values / scale))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_speed_steps_lie_in_the_envelope_recorded_from_the_firmware(sign: float) -> None:
    physics = RoverPhysics()
    up = run(physics, Demand(sign * 0.5), 2.5)[:, 0]
    assert at_times(up, sign * 0.5) == pytest.approx(SPEED_UP, abs=ENVELOPE)
    assert up[-1] / (sign * 0.5) == pytest.approx(1.04, abs=0.02)
    down = run(physics, Demand(), 2.0)[:, 0]
    assert at_times(down, sign * 0.5) == pytest.approx(SPEED_DOWN, abs=ENVELOPE)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_turn_steps_lie_in_the_envelope_recorded_from_the_firmware(sign: float) -> None:
    physics = RoverPhysics()
    up = run(physics, Demand(None, sign * 0.6), 2.0)[:, 1]
    assert at_times(up, sign * 0.6) == pytest.approx(TURN_UP, abs=ENVELOPE)
    down = run(physics, Demand(), 2.0)[:, 1]
    assert at_times(down, sign * 0.6) == pytest.approx(TURN_DOWN, abs=ENVELOPE)


def test_braking_takes_the_measured_distance() -> None:
    physics = RoverPhysics()
    run(physics, Demand(0.5), 6.0)
    start = physics.pose[0]
    speeds = run(physics, Demand(), 2.0)[:, 0]
    assert physics.pose[0] - start == pytest.approx(0.225, abs=0.02)
    assert physics.stopped
    assert speeds.min() >= 0.0, "a brake does not reverse"
