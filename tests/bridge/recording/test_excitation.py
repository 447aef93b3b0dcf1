"""Random driving stays inside its fence, whatever the robot's lag, and shows all four sign
scenarios.
"""

import math
from collections import Counter

import pytest

from firmware_bridge.messages import ConfigError, State
from firmware_bridge.recording.excitation import Excitation
from firmware_bridge.runtime.controller_thread import unicycle_arc
from firmware_bridge.safety.limits import Limits

FENCE = (-1.0, -2.0, 3.0, 2.0)


def drive(controller, limits, seconds, lag, delay, gain, period=0.1, dt=0.02):
    """A robot with first-order lag in both speeds, poses `delay` late, limits on acceleration,
    and too much speed.
    """
    state, past, out, command, wanted = (
        State(1.0, 0.0, 0.3, 0.0, 0.0, 0.0),
        [],
        [],
        (0.0, 0.0),
        (0.0, 0.0),
    )
    keep, late, every = math.exp(-dt / lag), round(delay / dt), round(period / dt)
    for k in range(round(seconds / dt)):
        past.append(state)
        if k % every == 0:
            seen = past[max(0, len(past) - 1 - late)]
            c = controller(State(seen.x, seen.y, seen.theta, seen.v, seen.omega, state.stamp))
            wanted = (c.v, c.omega)
        command = limits.slew(command, wanted, dt)
        v, omega = (
            gain * c + (s - gain * c) * keep
            for c, s in zip(command, (state.v, state.omega), strict=True)
        )
        state = unicycle_arc(state, v, omega, dt)
        out.append((state, wanted, controller.returning))
    return out


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("lag", "delay", "gain"), [(0.05, 0.02, 1.0), (0.3, 0.15, 1.1)])
def test_it_never_leaves_the_fence(seed, lag, delay, gain):
    limits = Limits()
    for state, (v, omega), _ in drive(
        Excitation(FENCE, limits, seed=seed), limits, 200.0, lag, delay, gain
    ):
        assert FENCE[0] <= state.x <= FENCE[2] and FENCE[1] <= state.y <= FENCE[3]
        assert abs(v) <= limits.v_max and abs(omega) <= limits.omega_max


def test_all_four_scenarios_come_and_most_of_the_time_is_spent_at_random():
    limits = Limits()
    out = drive(Excitation(FENCE, limits), limits, 300.0, 0.1, 0.05, 1.0)
    free = [command for _, command, returning in out if not returning]
    signs = Counter((v > 0, w > 0) for v, w in free)
    assert len(signs) == 4 and min(signs.values()) > 0.1 * len(free) and len(free) > 0.5 * len(out)
    assert len({v for v, _ in free}) > 100


def test_a_robot_that_must_not_reverse_never_does():
    limits = Limits(v_reverse=0.0)
    assert all(
        v >= 0.0 for _, (v, _), _ in drive(Excitation(FENCE, limits), limits, 120.0, 0.1, 0.05, 1.0)
    )


def test_the_same_seed_drives_the_same_way():
    runs = [
        [
            c
            for _, c, _ in drive(
                Excitation(FENCE, Limits(), seed=s), Limits(), 20.0, 0.1, 0.05, 1.0
            )
        ]
        for s in (3, 3, 4)
    ]
    assert runs[0] == runs[1] != runs[2]


def test_a_fence_that_is_too_small_is_refused():
    with pytest.raises(ConfigError, match="too small to drive in at random at 0.3 m/s"):
        Excitation((0.0, 0.0, 1.0, 5.0), Limits())
