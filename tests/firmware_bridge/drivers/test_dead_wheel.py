"""A wheel that is driven and whose counter stands stops the robot: its encoder may be unplugged."""

import numpy as np
import pytest
from boards import DRIVERS, Rig, patient
from waiting import until

from firmware_bridge.drivers.polled.wheel_checks import DeadWheels

TICK = 0.02


def watched(told, turns, count=0.001):
    """Faults after each of N looks at both wheels (N, 2) [rad/s], (N, 2) [rad]."""
    wheels, found = DeadWheels(("left", "right"), 0.05, count), []
    for k, (speeds, steps) in enumerate(zip(told, turns, strict=True)):
        wheels.take(tuple(speeds), tuple(steps), TICK * k)
        found.append(wheels.faults())
    return found


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("speed", [6.0, -6.0, 1.0])
def test_one_counter_that_stands_is_reported(side, speed):
    told = np.full((300, 2), speed)
    turned = told * TICK
    turned[:, side] = 0.0
    found = watched(told, turned)
    first = next(k for k, faults in enumerate(found) if faults)
    assert first * TICK == pytest.approx(max(1.0, 3.0 / abs(speed)), abs=2 * TICK)
    assert len(found[first]) == 1 and ("left", "right")[side] in found[first][0]


def test_lag_reversing_creeping_and_standing_are_no_fault():
    draw = np.random.default_rng(1)
    told = np.repeat(draw.uniform(-8.0, 8.0, (40, 2)), 25, axis=0)
    late = np.vstack([np.zeros((25, 2)), told])[: len(told)]
    assert not any(watched(told, 0.5 * late * TICK))
    assert not any(watched(np.zeros((500, 2)), np.zeros((500, 2))))
    dither = np.repeat(np.array([[1.0, -1.0], [-1.0, 1.0]] * 10), 25, axis=0)
    assert not any(watched(dither, np.zeros_like(dither)))


@pytest.mark.parametrize("name", DRIVERS)
def test_every_board_reports_a_dead_encoder_until_it_is_released(name, tmp_path):
    rig = Rig(name, f"pty:{tmp_path / 'link'}", patient(name))
    stood, counter = {}, rig.emulator._turns
    try:
        rig.connect().is_ready()
        rig.starts(0.3, 0.0)
        rig.drive(0.3, 0.0, 1.2 if name == "roboclaw" else 0.2)
        assert rig.driver.health().faults == ()
        rig.emulator._turns = lambda channel: (
            stood.setdefault(channel, counter(channel)) if channel == 1 else counter(channel)
        )
        stands = lambda: "counter stands" in str(rig.driver.health().faults)  # noqa: E731
        assert until(lambda: rig.command(0.3, 0.0) or stands())
        assert until(lambda: rig.driver.send(0.0, 0.0) or stands()), "it was not mended"
        rig.driver.stop()
        assert until(lambda: not stands())
    finally:
        rig.close()
