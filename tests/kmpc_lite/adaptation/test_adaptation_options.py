"""What the options of adaptation mean for the paper's robot, on both sides of each number."""

import pytest

from kmpc_lite.adaptation.adapted_model import refuse
from kmpc_lite.adaptation.gains import Gains
from kmpc_lite.adaptation.options import AdaptationOptions

OPTIONS = AdaptationOptions()


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
