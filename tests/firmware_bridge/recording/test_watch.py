"""A robot that does not do what it is told is told so soon; one that does is never accused."""

import math
import re

import pytest

from firmware_bridge.messages import State
from firmware_bridge.recording.excitation import Excitation
from firmware_bridge.recording.watch import DriveWatch
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_table import Action, GateState
from firmware_bridge.safety.limits import Limits
from tests.helpers.simulated_robot import TICK, Simulated

LIMITS = Limits()


def drive(seconds=60.0, seed=0, **robot):
    simulated = Simulated(LIMITS, **robot)
    delay = lambda: simulated.watch.delay  # noqa: E731
    fence = (-2.0, -2.0, 2.0, 2.0)
    simulated.drive(Excitation(fence, LIMITS, seconds=seconds, seed=seed, delay=delay), seconds)
    return simulated


@pytest.mark.parametrize(
    ("robot", "words", "seconds", "metres"),
    [
        ({"gains": (-1.0, 1.0)}, "commanded to drive forward it goes back", 4.1, 0.9),
        ({"gains": (1.0, -1.0)}, "commanded to turn left it turns right", 4.1, 1.0),
        ({"gains": (0.0, 0.0)}, "commanded to drive .* it moved 0.0", 8.0, 0.0),
        ({"gains": (0.0, 0.0), "noise": (0.02, 0.03)}, "commanded to .* by its pose", 8.0, 0.0),
        ({"gains": (1.0, 0.0)}, "commanded to turn .* it (hardly moved|turned 0.0)", 10.0, 2.0),
        ({"gains": (0.0, 0.0), "noise": (0.0, 0.0)}, "it moved 0.00 m .* by its pose", 4.0, 0.0),
        ({"frozen_after": 20.0}, "commanded to .* by its pose", 24.0, 2.8),
    ],
)
@pytest.mark.parametrize("seed", range(2))
def test_what_it_does_wrong_is_told_before_it_has_gone_far(robot, words, seconds, metres, seed):
    simulated = drive(seed=seed, **robot)
    assert re.search(words, simulated.trouble)
    assert simulated.state.stamp < seconds
    assert math.hypot(simulated.state.x, simulated.state.y) <= metres + 1e-9


@pytest.mark.parametrize(
    "robot",
    [
        {"noise": (0.02, 0.05)},
        {"lag": 0.0, "dead_time": 0.0},
        {"lag": 0.8, "dead_time": 0.5},
        {"gains": (0.8, 0.37), "noise": (0.02, 0.03)},
        {"gains": (1.3, 1.2)},
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_a_robot_that_obeys_late_or_by_half_is_not_accused(robot, seed):
    simulated = drive(seed=seed, **robot)
    assert simulated.trouble == "" and simulated.state.stamp > 59.0


def test_a_row_holds_the_mean_command_of_its_period_and_a_stretch_ends_where_it_is_interrupted():
    watch = DriveWatch(0.1, LIMITS)
    for k in range(40):
        state = GateState.HOLDING if 15 <= k < 20 else GateState.ACTIVE
        output = GateOutput(0.1 if k % 2 else 0.3, 0.4, Action.SEND, state, ())
        watch.on_tick(k * TICK, State(0.01 * k, 0.0, 0.0, 0.1, 0.0, k * TICK), output, True, False)
    assert list(map(len, watch.stretches)) == [2, 3]
    for row in (row for stretch in watch.stretches for row in stretch):
        assert 0.15 < row[0] < 0.25 and row[1] == pytest.approx(0.4)


def test_by_hand_the_measured_speeds_are_kept_and_nothing_is_judged():
    watch = DriveWatch(0.1, LIMITS, by_hand=True)
    for k in range(500):
        output = GateOutput(0.0, 0.0, Action.NOTHING, GateState.IDLE, ())
        watch.on_tick(k * TICK, State(0.0, 0.0, 0.0, 0.2, -0.3, k * TICK), output, False, False)
    assert watch.trouble == "" and len(watch.stretches[0]) > 90
    assert watch.stretches[0][5] == pytest.approx((0.2, -0.3, 0.0))
