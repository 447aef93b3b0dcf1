"""An emulated rover with steered wheels turns as the real firmware's does (`--model rover`)."""

from __future__ import annotations

import math

import pytest

from kmpc_lab.emulator.rover.physics import Demand, DriveLimits
from kmpc_lab.emulator.rover.steered import SteeredRover

RADIUS = 0.9
AS_DELIVERED, SCALED = (1.0, 0.75, 0.2), (0.1, 9.0, 1.8)
"""rover.parm's MOT_SPD_SCA_BASE, ATC_STR_RAT_FF and P; and those of docs/howto/boards.md."""
RECORDED = [
    (AS_DELIVERED, 0.5, 0.4, 0.207),
    (AS_DELIVERED, -0.5, 0.4, 0.188),
    (SCALED, 0.5, 0.5, 0.520),
    (SCALED, 0.5, -0.3, -0.319),
    (SCALED, 0.2, 0.2, 0.205),
    (SCALED, -0.5, 0.5, 0.487),
    (SCALED, -0.5, -0.3, -0.304),
    (AS_DELIVERED, 0.0, 0.4, 0.0),
]
"""Parameters, speed and turn rate that were asked for, and the turn rate 1 s to 2 s after that, of
ArduPilot Rover 4.6.3."""


def limits(steering: tuple[float, float, float]) -> DriveLimits:
    return DriveLimits(1.0, 1.0, math.radians(120.0), math.radians(60.0), steering)


@pytest.mark.parametrize(("steering", "speed", "turn", "turned"), RECORDED)
def test_turn_rates_are_those_recorded_from_the_firmware(
    steering: tuple[float, float, float], speed: float, turn: float, turned: float
) -> None:
    rover = SteeredRover(RADIUS)
    for _ in range(200):
        rover.step(Demand(speed or None, turn), limits(steering), 0.02)
    # its integral and its speed loop wander by that much
    assert rover.velocity[2] == pytest.approx(turned, abs=0.03)


def test_a_rover_that_is_asked_for_more_drives_its_tightest_circle() -> None:
    rover = SteeredRover(RADIUS)
    for _ in range(400):
        rover.step(Demand(-0.4, 1.0), limits(SCALED), 0.02)
        east, north, turn = rover.velocity
        assert abs(turn) <= math.hypot(east, north) / RADIUS * 1.001 + 1e-6
    assert rover.velocity[2] == pytest.approx(math.hypot(east, north) / RADIUS, rel=0.01)
