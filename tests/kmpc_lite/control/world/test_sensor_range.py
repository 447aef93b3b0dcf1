"""`NavigationProblem.sensor_range`: the speed follows from what is known and from braking."""

import math

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.plants.robots import DifferentialDrive

CIRCLE = kl.Circle(0.3, 0.0, 0.2)
START, GOAL = (-1.7, 0.0, 0.0), (1.7, 0.1, 0.0)


def problem(reach: float, speed: float = 1.5) -> kl.NavigationProblem:
    return kl.NavigationProblem(
        u_min=(-speed, -2.0), u_max=(speed, 2.0), du_max=(1.5, 5.0), sensor_range=reach
    )


def drive(reach: float) -> list[kl.Plan]:
    """Past a circle that is given when it is within reach."""
    controller = kl.Controller(kl.nominal_unicycle(0.1), problem(reach))
    plant, pose, plans = DifferentialDrive(), np.array(START), []
    for _ in range(100):
        away = math.hypot(CIRCLE.x - pose[0], CIRCLE.y - pose[1]) - CIRCLE.radius - 0.15
        plans.append(controller.step(pose, GOAL, [CIRCLE] if away <= reach else []))
        pose = plant.trace(pose, plans[-1].command, 0.1, 4)[-1]
        if plans[-1].holding:
            break
    return plans


def test_the_speed_follows_from_sight_and_braking() -> None:
    fastest = []
    for reach in (0.3, 0.5, 1.0):
        plans = drive(reach)
        assert plans[-1].holding
        assert all(p.status is not kl.PlanStatus.STOPPED for p in plans)
        places = np.array([p.states[0, :2] for p in plans])
        gaps = np.hypot(*(places - CIRCLE[:2]).T) - CIRCLE.radius - 0.15
        assert gaps.min() > 0.0
        fastest.append(max(abs(float(p.command[0])) for p in plans))
    # a robot that saw the obstacle at once and braked at once would drive at this speed
    assert fastest[0] < fastest[1] < fastest[2]
    for speed, reach in zip(fastest, (0.3, 0.5, 1.0), strict=True):
        assert 0.7 * math.sqrt(2 * 1.5 * reach) < speed <= 1.05 * math.sqrt(2 * 1.5 * reach)


@pytest.mark.parametrize("reach", [0.0, -1.0, math.nan, math.inf, "far", True])
def test_ranges_that_are_none_are_refused(reach: object) -> None:
    with pytest.raises(kl.ProblemError, match="sensor_range"):
        kl.NavigationProblem(sensor_range=reach)  # type: ignore[arg-type]


def test_without_margins_nothing_would_keep_it() -> None:
    with pytest.raises(kl.ProblemError, match="tightening"):
        kl.Controller(kl.nominal_unicycle(0.1), problem(1.0), tightening=None)
