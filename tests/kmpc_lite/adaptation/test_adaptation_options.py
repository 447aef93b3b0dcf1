"""What the options of adaptation mean for the paper's robot, on both sides of each number."""

from __future__ import annotations

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.adaptation.adapted_model import refuse
from kmpc_lite.adaptation.gains import Gains
from kmpc_lite.adaptation.online import OnlineAdaptation
from kmpc_lite.adaptation.options import AdaptationOptions

DT = 0.1
OPTIONS = AdaptationOptions()


def new(dt: float = DT) -> OnlineAdaptation:
    return OnlineAdaptation(kl.nominal_unicycle(dt))


def seen(v: float, omega: float, moved: float, turned: float = 0.0) -> str:
    """What becomes of a period in which a robot at the origin came so far ahead and turned."""
    adaptation = new()
    adaptation.update(np.zeros(3), np.array([v, omega]), np.array([moved, 0.0, turned]))
    counts = adaptation.counts
    return "used" if counts.used else "rejected" if counts.rejected else "still"


def test_a_step_of_two_millimetres_or_milliradians_tells_of_the_floor() -> None:
    assert seen(0.0199, 0.0, 0.00199) == "still" and seen(0.0201, 0.0, 0.00201) == "used"
    assert seen(0.0, 0.0199, 0.0, 0.00199) == "still"
    assert seen(0.0, 0.0201, 0.0, 0.00201) == "used"


def test_three_times_what_was_commanded_and_five_centimetres_more_is_a_jump() -> None:
    assert seen(0.5, 0.0, 0.199) == "used" and seen(0.5, 0.0, 0.201) == "rejected"
    assert seen(0.5, 0.5, 0.05, 0.299) == "used" and seen(0.5, 0.5, 0.05, 0.301) == "rejected"


def test_who_does_less_than_a_tenth_is_held() -> None:
    # two centimetres, or 0.03 rad, should have been driven
    assert seen(0.199, 0.0, 0.0) == "used" and seen(0.201, 0.0, 0.0) == "rejected"
    assert seen(0.0, 0.299, 0.0) == "used" and seen(0.0, 0.301, 0.0) == "rejected"
    # a tenth of the five centimetres that should have been driven, and of the two above
    assert seen(0.5, 0.0, 0.0071) == "used" and seen(0.5, 0.0, 0.0069) == "rejected"


@pytest.mark.parametrize(
    ("floor", "robot"),
    [
        (Gains(ahead=0.201), Gains(ahead=0.199)),
        (Gains(ahead=2.49), Gains(ahead=2.51)),
        (Gains(turn=0.201), Gains(turn=0.199)),
        (Gains(turn=2.49), Gains(turn=2.51)),
        # of a speed of one
        (Gains(ahead=0.8029, left=0.596), Gains(ahead=0.7975, left=0.604)),
        (Gains(pull=1.99), Gains(pull=2.01)),
    ],
)
def test_gains_of_a_floor_and_those_of_another_robot(floor: Gains, robot: Gains) -> None:
    assert refuse(floor, OPTIONS, 1.0) is None
    assert refuse(robot, OPTIONS, 1.0) is not None
