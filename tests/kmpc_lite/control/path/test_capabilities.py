"""Ways are timed by what the robot can do, in either gear."""

from dataclasses import replace

import numpy as np
import pytest
from guided import GuideInUse

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.control.margins.margins import Margins
from kmpc_lite.control.options import GuidanceOptions, lengths_from_radii
from kmpc_lite.control.path.capabilities import (
    capabilities,
    clearance_at_speed,
    drivable_speeds,
)
from kmpc_lite.model.noise_model import NoiseModel

PROBLEM = kl.NavigationProblem()
WIDE = lengths_from_radii(GuidanceOptions(), PROBLEM.robot_radius).wide_clearance


def fitted(turn_gain: float, slip: float = 0.05) -> kl.KoopmanModel:
    return kl.fit(
        kmpc_lab.generate_dataset(
            kmpc_lab.DifferentialDrive(slip, seed=1, turn_gain=turn_gain),
            episodes=60,
            steps=100,
            seed=2,
        )
    )


def test_a_robot_that_obeys_is_timed_at_the_bounds(nominal: kl.KoopmanModel) -> None:
    np.testing.assert_array_equal(drivable_speeds(nominal, PROBLEM), [0.6, 0.6, np.pi / 4])
    one_sided = kl.NavigationProblem(u_min=(0.0, -0.5), u_max=(0.3, 0.8))
    np.testing.assert_array_equal(drivable_speeds(nominal, one_sided), [0.3, 0.0, 0.5])
    # one that slips ahead drives faster than commanded; that is not asked for
    np.testing.assert_array_equal(drivable_speeds(fitted(1.0, 0.2), PROBLEM), [0.6, 0.6, np.pi / 4])


def test_the_slower_gear_is_for_ways_in_reverse_alone() -> None:
    nothing = np.empty((0, 5))

    def seconds(speeds: tuple[float, float, float], start: float, goal: float) -> float:
        end = np.array([goal, 0.0, 0.0])
        guide = GuideInUse(PROBLEM)
        guide.drive_at(*speeds)
        return guide.reference(np.array([start, 0.0, 0.0]), end, nothing).time_left

    assert seconds((0.6, 0.05, 0.8), 0.0, 1.5) == pytest.approx(1.5 / 0.6)
    assert seconds((0.6, 0.3, 0.8), 1.5, 0.9) == pytest.approx(0.6 / 0.3)
    # turning twice and driving forwards is quicker than that crawl
    assert seconds((0.6, 0.05, 0.8), 1.5, 0.0) < 1.5 / 0.05 / 2


def test_how_sharply_a_car_drives_is_what_its_model_knows(nominal: kl.KoopmanModel) -> None:
    problem = kl.NavigationProblem(u_min=(-0.6, -1.5), u_max=(0.6, 1.5), wheels=kl.Car(0.4))
    assert capabilities(nominal, problem).curving == pytest.approx(1.0)
    assert capabilities(nominal, PROBLEM).curving == 1.0
    # its turns are 0.8 of what they should be, or its way is 1.25 times as long
    for turn, ahead in ((0.8, 1.0), (1.0, 1.25)):
        gains = np.diag((ahead, ahead, turn))
        weak = replace(nominal, B=gains @ nominal.B, H=gains @ nominal.H)
        known = capabilities(weak, problem)
        assert known.curving == pytest.approx(0.8, rel=1e-3)
        adapted = capabilities(nominal, problem).adapted(weak, problem, 0.9)
        assert adapted.curving == known.curving


def test_a_way_leaves_room_for_the_margins_of_a_robot_that_lags(
    nominal: kl.KoopmanModel, lagging: kl.KoopmanModel
) -> None:
    noise = NoiseModel(np.stack([np.zeros((3, 3)), np.diag([1e-3, 1e-3, 1e-3]), np.zeros((3, 3))]))
    model, nothing = replace(lagging, noise_model=noise), np.empty((0, 5))
    margins = Margins(model, PROBLEM)
    room = clearance_at_speed(PROBLEM, margins)
    assert room > WIDE and room > clearance_at_speed(
        PROBLEM, Margins(replace(model, noise_model=None), PROBLEM)
    )
    circle, ends = (
        np.array([[0.0, -0.05, 0.2, 0.0, 0.0]]),
        (np.array([-1.5, 0.0, 0.0]), np.array([1.5, 0.0, 0.0])),
    )

    def gap(model: kl.KoopmanModel, circles: np.ndarray) -> float:
        known = capabilities(model, PROBLEM, Margins(model, PROBLEM))
        guide = GuideInUse(PROBLEM, known)
        assert guide.reference(*ends, nothing).reachable
        return float(
            np.hypot(*(guide.reference(*ends, circles).path - circle[0, :2]).T).min()
            - 0.2
            - PROBLEM.robot_radius
        )

    assert gap(nominal, circle) == pytest.approx(WIDE, abs=2e-3)
    assert gap(model, circle) == pytest.approx(room, abs=2e-3)
    # if there is no such room, less will do
    wall = np.array(
        [
            [0.0, side * (PROBLEM.robot_radius + 0.24 + 0.3 * k), 0.2, 0.0, 0.0]
            for k in range(7)
            for side in (-1, 1)
        ]
    )
    guide = GuideInUse(PROBLEM, capabilities(model, PROBLEM, margins))
    assert guide.reference(*ends, wall).reachable
