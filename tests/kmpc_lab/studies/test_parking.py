"""Cars park, scenes are as they say, and the study would see it if something was touched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kmpc_lab.studies.parking.cars import Bicycle, random_car
from kmpc_lab.studies.parking.drives import drive, format_rows, judge, shortest_seconds
from kmpc_lab.studies.parking.scenes import KINDS, Scene, scene_of
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


def test_the_plant_turns_its_wheels_at_their_rate_and_stands_steered() -> None:
    car = replace(random_car(1), steering_rate=1.0 / random_car(1).radius, slip=0.0)
    plant, sharp = Bicycle(car, 0), 1.0 / car.radius
    pose = plant.drive(np.zeros(3), np.array((car.speed, car.speed * sharp)))[-1]
    # a tenth of the largest curvature after a tenth of a second: half of that on the mean
    assert 0.03 < pose[2] * car.radius / (0.1 * car.speed) < 0.08
    assert not plant.drive(np.zeros(3), np.zeros(2)).any()


def test_the_shortest_curve_straight_ahead_takes_the_time_of_its_length() -> None:
    car = random_car(2)
    there = np.array((3.0 * car.length, 0.0, 0.0))
    assert shortest_seconds(car, np.zeros(3), there) == pytest.approx(3.0 * car.length / car.speed)


def test_a_car_parks_in_the_open_and_a_touch_is_seen() -> None:
    row = drive("open", 4)
    assert row.in_pose and row.gear_changes <= 3
    assert row.seconds < 2.0 * row.shortest_seconds
    car = random_car(4)
    half = 0.1 * car.length
    on_it = Polygon([(-half, -half), (half, -half), (half, half), (-half, half)])
    touched = judge("open", 4, car, Scene(np.zeros(3), np.array((1.0, 0.0, 0.0)), [on_it]))
    assert touched.collided and not touched.in_pose
    assert "open, car 4: touched" in format_rows([row, touched])
