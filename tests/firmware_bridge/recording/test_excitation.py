"""Random driving stays inside its fence, whatever the robot's lag, and shows all four sign
scenarios.
"""

import math

import numpy as np
import pytest

from firmware_bridge.messages import STILL, ConfigError, State
from firmware_bridge.recording.excitation import Excitation
from firmware_bridge.runtime.controller_thread import unicycle_arc
from firmware_bridge.safety.gate_settings import Limits
from firmware_bridge.wheels import Wheels
from kmpc_lite.learn.coverage import find_coverage
from tests.helpers.simulated_robot import Simulated

FENCE = (-1.0, -2.0, 3.0, 2.0)


def drive(controller, limits, seconds, lag, delay, gain, period=0.1, dt=0.02):
    """A robot with first-order lag in both speeds, poses `delay` late, limits on acceleration,
    and too much speed.
    """
    state, past, out, command, wanted = (State(1.0, 0.0, 0.3, 0.0, 0.0, 0.0), [], [], STILL, STILL)
    keep, late, every = math.exp(-dt / lag), round(delay / dt), round(period / dt)
    for k in range(round(seconds / dt)):
        past.append(state)
        if k % every == 0:
            seen = past[max(0, len(past) - 1 - late)]
            c = controller(State(seen.x, seen.y, seen.theta, seen.v, seen.omega, state.stamp))
            wanted = c.speeds
        command = limits.slew(command, wanted, dt)
        v, omega, vy = (
            gain * c + (s - gain * c) * keep
            for c, s in zip(command, (state.v, state.omega, state.vy), strict=True)
        )
        state = unicycle_arc(state, v, omega, dt, vy)
        out.append((state, wanted, controller.returning))
    return out


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("lag", "delay", "gain"), [(0.05, 0.02, 1.0), (0.3, 0.15, 1.1)])
def test_it_never_leaves_the_fence(seed, lag, delay, gain):
    limits = Limits()
    for state, (v, omega, _), _ in drive(
        Excitation(FENCE, limits, seed=seed), limits, 200.0, lag, delay, gain
    ):
        assert FENCE[0] <= state.x <= FENCE[2] and FENCE[1] <= state.y <= FENCE[3]
        assert abs(v) <= limits.v_max and abs(omega) <= limits.omega_max


def test_a_fence_that_is_far_too_small_is_refused_with_the_speed_that_it_would_bear():
    with pytest.raises(ConfigError, match="too small to drive in at random at 3 m/s: at most 0.2"):
        Excitation((0.0, 0.0, 1.0, 5.0), Limits(v_max=3.0))


ROBOTS = {
    "micro": (0.6, Limits(v_max=0.2, v_reverse=0.2, omega_max=3.0), 0.05, 0.02, 1.0),
    "husky": (8.0, Limits(v_max=1.0, v_reverse=1.0, omega_max=1.0), 0.3, 0.1, 0.37),
    "warthog": (30.0, Limits(v_max=4.0, v_reverse=4.0, omega_max=2.0), 0.4, 0.1, 0.63),
    "forward only": (2.0, Limits(v_reverse=0.0), 0.2, 0.1, 1.0),
    "slow turner": (4.0, Limits(v_max=0.5, v_reverse=0.5, omega_max=0.15), 0.3, 0.1, 1.0),
    "late": (5.0, Limits(v_max=0.5, v_reverse=0.5), 0.8, 0.5, 1.0),
}


@pytest.mark.parametrize("name", ROBOTS)
def test_any_robot_stays_inside_and_its_log_shows_all_that_a_model_needs(name):
    half, limits, lag, dead_time, turns = ROBOTS[name]
    period = 0.05 if name == "micro" else 0.1
    seconds = 180.0 if name in ("warthog", "slow turner") else 90.0
    robot = Simulated(limits, lag, dead_time, gains=(1.0, turns), period=period)
    excitation = Excitation(
        (-half, -half, half, half), limits, seconds=seconds, seed=1, delay=lambda: robot.watch.delay
    )
    poses = robot.drive(excitation, seconds)
    assert robot.watch.trouble == excitation.trouble == ""
    assert max(max(abs(p.x), abs(p.y)) for p in poses) < half
    assert 0.3 * (lag + dead_time) < robot.watch.delay < 1.5 * (lag + dead_time) + 2.0 * period
    rows = [np.array(stretch)[:, :2] for stretch in robot.watch.stretches]
    coverage = find_coverage(rows, period, excitation.largest)
    assert coverage.is_complete, coverage.advice()


def test_a_robot_that_goes_on_towards_the_fence_is_trouble():
    excitation = Excitation((-2.0, -2.0, 2.0, 2.0), Limits())
    for k in range(200):
        excitation(State(0.02 * k, 0.0, 0.0, 0.2, 0.0, 0.1 * k))
        if excitation.trouble:
            break
    assert "towards the fence although commanded to turn back" in excitation.trouble
    assert 0.02 * k < 2.0


CAR = Wheels("car", turning_radius=0.4)
FORWARD = Wheels("car", turning_radius=0.3, reverse=False)


class CarRobot(Simulated):
    """It turns only while it rolls, at most by its tightest circle."""

    wheels = CAR

    def drive(self, controller, seconds):
        def obeyed(state):
            command = controller(state)
            assert abs(command.omega) <= abs(command.v) / self.wheels.radius + 1e-9
            return command

        return super().drive(obeyed, seconds)


@pytest.mark.parametrize(("wheels", "half"), [(CAR, 2.0), (FORWARD, 3.5)])
def test_a_car_keeps_to_its_circle_stays_inside_and_shows_what_a_model_needs(wheels, half):
    limits = Limits(v_reverse=0.3 if wheels.reverse else 0.0, omega_max=1.0)
    robot = CarRobot(limits, 0.2, 0.1)
    robot.wheels = wheels
    excitation = Excitation(
        (-half, -half, half, half), limits, seconds=180.0, delay=lambda: robot.watch.delay,
        wheels=wheels,
    )  # fmt: skip
    poses = robot.drive(excitation, 180.0)
    assert robot.watch.trouble == excitation.trouble == ""
    assert max(max(abs(p.x), abs(p.y)) for p in poses) < half
    rows = [np.array(stretch)[:, :2] for stretch in robot.watch.stretches]
    coverage = find_coverage(rows, 0.1, excitation.largest, steered=True)
    assert coverage.is_complete, coverage.advice()


def test_a_fence_in_which_a_car_cannot_turn_back_is_refused():
    with pytest.raises(ConfigError, match="too small"):
        Excitation((-1.0, -1.0, 1.0, 1.0), Limits(v_reverse=0.0), wheels=FORWARD)


def test_an_omni_is_driven_sideways_to_either_side_and_stays_inside():
    limits = Limits(v_sideways=0.2)
    robot = Simulated(limits, 0.2, 0.1)
    excitation = Excitation((-1.5, -1.5, 1.5, 1.5), limits, seconds=90.0, wheels=Wheels("omni"))
    poses = robot.drive(excitation, 90.0)
    assert robot.watch.trouble == excitation.trouble == ""
    assert max(max(abs(p.x), abs(p.y)) for p in poses) < 1.5
    aside = np.array([row[2] for stretch in robot.watch.stretches for row in stretch])
    assert (aside > 0.1).mean() > 0.1 and (aside < -0.1).mean() > 0.1
    assert np.abs(aside).max() <= 0.2 + 1e-9


def test_an_omni_whose_wheels_are_exchanged_is_stopped():
    limits = Limits()
    robot = Simulated(limits, 0.2, 0.1, gains=(1.0, 1.0, -1.0))
    robot.drive(Excitation((-2, -2, 2, 2), limits, seconds=60.0, wheels=Wheels("omni")), 60.0)
    assert "drive sideways left it goes right" in robot.trouble


def test_in_a_small_fence_it_drives_more_slowly_and_says_so():
    excitation = Excitation((-0.4, -0.4, 0.4, 0.4), Limits())
    assert 0.1 < excitation.largest[0] == excitation.largest[1] < 0.2
    assert "room for 0.1" in excitation.note and Excitation(FENCE, Limits()).note == ""
    for state, (v, *_), _ in drive(excitation, Limits(), 120.0, 0.2, 0.1, 1.0):
        assert max(abs(state.x - 1.0), abs(state.y)) < 1.0 or abs(v) < 0.2
