"""Cars park, scenes are as they say, and the study would see it if something was touched."""

from dataclasses import replace

import numpy as np
import pytest

from kmpc_lab.studies.parking import KINDS, Scene, drive, judge, random_car, scene_of
from kmpc_lite.control import Polygon
from kmpc_lite.scenario.touch import footprint_gaps


@pytest.mark.parametrize("kind", KINDS)
def test_start_and_goal_are_free_and_scenes_scale_with_the_car(kind: str) -> None:
    for seed in range(10):
        car = random_car(seed)
        scene = scene_of(kind, car, seed)
        poses = np.stack([scene.start, scene.goal])
        gaps = footprint_gaps(car.footprint, poses, np.empty((2, 0, 3)), scene.solids)
        assert (gaps > 0.0).all(), (kind, seed)
        # twice the car in the same scene: what is drawn of the scene is the same
        names = ("length", "width", "overhang", "radius", "speed")
        twice = replace(car, **{name: 2.0 * getattr(car, name) for name in names})
        goal = scene_of(kind, twice, seed).goal
        np.testing.assert_allclose(goal[:2], 2.0 * scene.goal[:2])


def test_a_car_parks_in_the_open_and_a_touch_is_seen() -> None:
    row = drive("open", 4)
    assert row.arrived and row.gear_changes <= 3
    assert row.seconds < 2.0 * row.ideal_seconds
    car = random_car(4)
    half = 0.1 * car.length
    on_it = Polygon([(-half, -half), (half, -half), (half, half), (-half, half)])
    touched = judge(4, car, Scene(np.zeros(3), np.array((1.0, 0.0, 0.0)), [on_it]))
    assert touched.collided and not touched.arrived


def test_wheels_that_turn_for_longer_than_is_foreseen_are_turned() -> None:
    row = drive("open, slow steering", 2)
    assert row.arrived and row.seconds < 1.5 * row.ideal_seconds
