"""Beams made turns: when one ends, when each beam was measured, what is no turn."""

import math

import numpy as np
import pytest

from firmware_bridge.sensors.lidar.lidar import LONGEST, Turns


def spin(turns, began, took, count=100):
    """A turn from a time on [s]; gives the time at its end."""
    turns.add([math.tau * (count - 1) / count], [2.0], began)  # of the turn before
    turns.add([math.tau * i / count for i in range(count)], [2.0] * count, began)
    return began + took


def end(turns, stamp):
    """The next turn begins."""
    turns.add([0.0], [2.0], stamp)


def test_a_turn_is_stamped_by_its_angles():
    turns = Turns(0.1, 12.0)
    over = spin(turns, 10.0, 0.2)
    assert turns.newest is None
    end(turns, over)
    sweep = turns.newest
    assert sweep.stamps[0] == pytest.approx(10.0) and sweep.stamps[50] == pytest.approx(10.1)
    assert sweep.stamp == pytest.approx(10.198) and np.all(np.diff(sweep.stamps) > 0.0)
    assert sweep.angles[25] == pytest.approx(-math.pi / 2)  # clockwise, reported counter-clockwise
    assert turns.rate(10.3) == pytest.approx(5.0) and turns.rate(13.0) == 0.0


@pytest.mark.parametrize(
    ("angles", "took"),
    [
        ([0.1] * 200, 0.1),  # a motor that is stuck
        ([0.05 * i for i in range(40)], 0.1),  # a third of a turn
        ([math.tau * i / 10 for i in range(10)], 0.1),
        ([math.tau * i / 100 for i in range(100)], 3.0),
        ([math.tau * i / 100 for i in range(100)], 0.001),
    ],
)
def test_what_is_no_turn_is_counted(angles, took):
    turns = Turns(0.1, 12.0)
    turns.add([6.2, *angles, 6.2], [1.0] * (len(angles) + 2), 1.0)
    end(turns, 1.0 + took)
    assert turns.newest is None and turns.counters["broken_turns"] == 1


def test_beams_without_end_are_bounded():
    turns = Turns(0.1, 12.0)
    for _ in range(100):
        turns.add([0.1] * 1000, [1.0] * 1000, 1.0)
    assert len(turns._angles) <= LONGEST + 1000 and turns.counters["broken_turns"] >= 9
