"""A robot that does not obey is reported soon; one that obeys is never accused."""

import math
import re

import pytest

from firmware_bridge.recording.excitation import Excitation
from firmware_bridge.safety.limits import Limits
from tests.helpers.simulated_robot import Simulated

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
def test_what_it_does_wrong_is_reported_before_it_has_gone_far(robot, words, seconds, metres, seed):
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
def test_a_robot_that_obeys_late_or_by_half_is_not_accused(robot):
    simulated = drive(seed=0, **robot)
    assert simulated.trouble == "" and simulated.state.stamp > 59.0
