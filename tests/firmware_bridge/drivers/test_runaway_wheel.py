"""A wheel that runs faster than commanded, or the other way, stops the robot."""

import numpy as np
import pytest
from boards import DRIVERS, Rig
from waiting import until

from firmware_bridge.drivers.polled.wheel_checks import RunawayWheels

TICK, TOP = 0.02, 20.0


def watched(told, speeds):
    """Faults after each of N looks at what both wheels are commanded, and do (N, 2) [rad/s]."""
    wheels, found = RunawayWheels(("left", "right"), TOP), []
    for k, (wanted, done) in enumerate(zip(told, speeds, strict=True)):
        wheels.take(tuple(wanted), tuple(done), TICK * k)
        found.append(wheels.faults())
    return found


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_wheel_at_full_power_is_reported_at_once(sign):
    told = np.full((100, 2), 5.0 * sign)
    speeds = told.copy()
    speeds[:, 1] = TOP
    first = next(k for k, faults in enumerate(watched(told, speeds)) if faults)
    assert first * TICK == pytest.approx(0.2, abs=1.5 * TICK)


def test_a_wheel_that_turns_the_other_way_is_reported_once_its_lag_is_over():
    told = np.full((100, 2), 8.0)
    speeds = told * (1.0, -1.0)
    found = watched(told, speeds)
    first = next(k for k, faults in enumerate(found) if faults)
    assert 0.9 <= first * TICK <= 1.3 and "right wheel turns against its command" in found[first][0]


@pytest.mark.parametrize("seed", range(5))
def test_lag_and_overshoot_are_no_fault(seed):
    draw = np.random.default_rng(seed)
    told = np.repeat(draw.uniform(-TOP, TOP, (40, 2)), 40, axis=0)
    late = np.vstack([np.zeros((25, 2)), told])[: len(told)]
    assert not any(watched(told, 1.2 * late))


@pytest.mark.parametrize("name", DRIVERS)
def test_every_board_reports_it_until_it_is_released(name, tmp_path):
    rig = Rig(name, f"pty:{tmp_path / 'link'}")
    try:
        rig.connect().is_ready()
        rig.starts(0.2, 0.0)
        rig.drive(0.2, 0.0, 1.2 if name == "roboclaw" else 0.2)
        assert rig.driver.health().faults == ()
        told = list(rig.emulator._body.command)
        step = rig.emulator._body._step

        def runs_away():
            command = list(rig.emulator._body.command)
            if any(command):
                rig.emulator._body.command[:] = [4.0 * told[0], command[1]]
            step()
            rig.emulator._body.command[:] = command

        rig.emulator._body._step = runs_away
        away = lambda: any("faster than" in f for f in rig.driver.health().faults)  # noqa: E731
        assert until(lambda: rig.command(0.2, 0.0) or away())
        rig.drive(0.0, 0.0, 0.5)
        assert away(), "it stands again, but nothing was mended"
        rig.driver.stop()
        assert until(lambda: not away())
    finally:
        rig.close()
