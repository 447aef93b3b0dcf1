"""A robot that is commanded to drive, and whose pose does not change, is stopped and given back."""

import math
from dataclasses import replace

import numpy as np
import pytest
from loop_bench import Bench, Desk

from firmware_bridge.messages import State, VelocityCommand
from firmware_bridge.runtime.controller_thread import unicycle_arc
from firmware_bridge.safety.gate_table import GateState, Reason
from firmware_bridge.safety.unmoved import Unmoved, UnmovedOptions

TICK = 0.02


def looks(commands, answer, options=None):
    """What is said when a robot `answer`s commands (N, 2), one a tick, with poses."""
    watch, here = Unmoved(options or UnmovedOptions()), State(1.0, 2.0, 3.0, 0.0, 0.0, 0.0)
    said = []
    for k, command in enumerate(commands):
        said.append(watch.look(GateState.ACTIVE, TICK * k, (*command, 0.0), here))
        here = answer(here, *command, k)
    return said


def stays(here, v, omega, k):
    return here


@pytest.mark.parametrize("command", [(0.3, 0.0), (-0.2, 0.0), (0.3, 0.8), (1.5, 0.0), (0.03, 0.0)])
def test_a_pose_that_stays_is_reported_once_enough_was_commanded(command):
    said = looks([command] * 500, stays)
    first = next(k for k, words in enumerate(said) if words)
    needed = 1.0 + 0.15 / abs(command[0])
    assert needed - TICK <= first * TICK <= 1.1 * needed + 0.25
    assert "it moved 0.00 m" in said[first]


def test_noise_does_not_hide_a_frozen_pose():
    draw = np.random.default_rng(1)
    noisy = [State(*draw.normal(0.0, 0.002, 3), 0.0, 0.0, 0.0) for _ in range(200)]
    assert any(looks([(0.3, 0.0)] * 200, lambda here, v, omega, k: noisy[k]))


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_that_lags_slips_and_turns_less_is_believed(seed):
    """Half a second late, a third of the speed, half of the turn, whatever the command."""
    draw = np.random.default_rng(seed)
    commands = np.repeat(draw.uniform((-0.5, -4.0), (0.5, 4.0), (20, 2)), 50, axis=0)
    late = np.vstack([np.zeros((25, 2)), commands])

    def lags(here, v, omega, k):
        return unicycle_arc(here, 0.3 * late[k][0], 0.5 * late[k][1], TICK)

    assert not any(looks(commands, lags))


def test_a_robot_that_stands_at_its_goal_or_dithers_is_not_reported():
    dither = [(0.1 * (-1) ** (k // 20), 0.4 * (-1) ** (k // 20)) for k in range(2000)]
    assert not any(looks(dither, stays))
    assert not any(looks([(0.0, 0.0)] * 1000, stays))
    assert not any(looks([(0.3, 0.0)] * 500, stays, UnmovedOptions(patience=0.0)))


def test_commands_during_a_stall_do_not_count():
    watch, here = Unmoved(UnmovedOptions()), State(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for k in range(40):
        assert not watch.look(GateState.ACTIVE, 0.5 * k, (0.3, 0.0, 0.0), here)


def test_a_pose_that_is_none_is_left_out():
    broken = State(math.nan, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert not any(looks([(0.3, 0.0)] * 200, lambda *_: broken)[1:75])


def test_the_loop_brakes_gives_back_and_drives_on_only_when_enabled():
    desk = Desk()
    bench = Bench(operator=desk).drive()
    frozen, driver = bench.driver.state(), bench.driver
    real = driver.state
    driver.state = bench.planner._poses = lambda: replace(frozen, stamp=bench.clock())
    assert bench.run(1.0) is GateState.ACTIVE
    assert bench.run(0.8) in (GateState.STOPPING, GateState.HOLDING)
    assert bench.run(3.0) is GateState.RELEASED
    assert Reason.UNMOVED in bench.loop.snapshot.output.reasons
    assert any("commanded to drive" in why for why in desk.why)
    driver.state = bench.planner._poses = real
    assert bench.run(3.0) is GateState.RELEASED, "nobody has said that it may drive"
    desk.requests = {"enable"}
    assert bench.run(3.0) is GateState.ACTIVE
    bench.controller = lambda state: VelocityCommand(0.0, 0.0, bench.clock())
    assert bench.run(5.0) is GateState.ACTIVE
