"""What the tracker's options mean for the paper's robot, on both sides of each number."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.kernels import tracks as kernel
from kmpc_lite.control.kernels.clearance import SPREAD_RATE, things_of
from kmpc_lite.control.kernels.tracks import WALKED
from kmpc_lite.control.world.tracker import ObstacleTracker
from kmpc_lite.control.world.tracking import Tracking
from kmpc_lite.control.world.tracks import TrackedCircles
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

DT = 0.1


def walked(speed: float, steps: int, radius: float = 0.2) -> ObstacleTracker:
    """A tracker that has seen somebody walk along x."""
    tracker = ObstacleTracker(DT)
    for k in range(steps):
        tracker.update([kl.Circle(DT * k * speed, 1.0, radius)])
    return tracker


def test_what_was_seen_once_is_known_to_two_centimetres_and_may_drive_twice_as_fast() -> None:
    tracks = walked(0.0, 1).tracks
    assert tracks.position_deviations[0] == pytest.approx(0.02)
    assert tracks.velocity_deviations[0] == pytest.approx(2.0 * 0.6)
    assert math.sqrt(tracks.covariances[0, 4, 4]) == pytest.approx(0.5)


def test_accelerations_of_two_thirds_of_the_fastest_speed_and_turns_of_two_seconds() -> None:
    tracker = walked(0.0, 1)
    before = tracker.tracks.covariances[0].copy()
    after, _ = kernel.follow(tracker.tracks.rows, *NOTHING, *tracker._follower.numbers)
    grown = after[0, kernel.COVARIANCE].reshape(5, 5) - before
    assert math.sqrt(grown[2, 2]) == pytest.approx(DT * 0.4)
    # after two seconds, a turn rate has faded to a share of 1 / e
    faded = math.exp(-2.0 * DT / 2.0)
    assert grown[4, 4] == pytest.approx((1.0 - faded) * (0.5**2 - before[4, 4]))


NOTHING = np.empty((0, 5)), np.empty(0)


@pytest.mark.parametrize(("share", "same"), [(0.995, True), (1.005, False)])
def test_who_is_where_chance_leads_once_in_ten_thousand_is_still_the_same(
    share: float, same: bool
) -> None:
    tracker = walked(0.0, 5)
    after, _ = kernel.follow(tracker.tracks.rows, *NOTHING, *tracker._follower.numbers)
    # it may have turned round, at any pace up to the robot's
    variance = after[0, kernel.COVARIANCE.start] + (DT * 0.6) ** 2 + 0.02**2
    away = share * math.sqrt(-2.0 * math.log(1e-4) * variance)
    found = tracker.follow(np.array([[after[0, 0] + away, after[0, 1], 0.2, 0.0, 0.0]]))
    assert bool(tracker.tracks.numbers[found[0]] == 0) is same


@pytest.mark.parametrize(("share", "moves"), [(0.995, False), (1.005, True)])
def test_who_stands_is_taken_to_move_once_in_a_thousand_times(share: float, moves: bool) -> None:
    tracker = walked(0.0, 5)
    tracks = tracker.tracks
    still = copy.deepcopy(tracker)
    still.follow(np.array([[*tracks.states[0, :2], 0.2, 0.0, 0.0]]))
    # a velocity that chance makes once in a thousand times, and a sight that confirms it
    variance = still.tracks.covariances[0, 2, 2]
    tracks.rows[0, 2] = share * math.sqrt(-2.0 * math.log(1e-3) * variance)
    moved, _ = kernel.follow(tracks.rows, *NOTHING, *tracker._follower.numbers)
    tracker.follow(np.array([[*moved[0, :2], 0.2, 0.0, 0.0]]))
    assert bool(tracker.tracks.moving[0]) is moves


def test_who_is_hidden_is_expected_for_a_second_and_a_half() -> None:
    tracker = walked(0.5, 30)
    left = [len(tracker.update(np.empty((0, 5)))) for _ in range(20)]
    assert sum(left) == pytest.approx(15, abs=1)


def test_who_was_seen_to_move_grows_by_three_standard_deviations_of_his_velocity() -> None:
    watch, state = Tracking(kl.NavigationProblem(), kl.ControllerOptions()), TrackedCircles()
    for k in range(12):
        seen = watch.see(state, things_of(np.array([[0.08 * k, 1.0, 0.2, 0.0, 0.0]]))).things
    assert seen[0, SPREAD_RATE] == pytest.approx(3.0 * state.tracks.velocity_deviations[0])


def test_two_hundred_circles_are_followed() -> None:
    circles = np.zeros((201, 5))
    circles[:, 0] = np.arange(201)
    found = ObstacleTracker(DT).follow(circles)
    assert np.flatnonzero(found < 0).tolist() == [200]


def scan(ranges: Array, step: float) -> kl.LaserScan:
    return kl.LaserScan(ranges, -0.5 * step * (len(ranges) - 1), step, 10.0)


def found(width: float, step: float = 0.01) -> int:
    """How many clusters a board across the view, two metres ahead, makes."""
    angles = step * (np.arange(201) - 100)
    y = 2.0 * np.tan(angles)
    hit = np.abs(y) <= 0.5 * width
    tracker = ObstacleTracker(DT)
    tracker.see(scan(np.where(hit, 2.0 / np.cos(angles), np.inf), step), np.zeros(3))
    return len(tracker.tracks)


@pytest.mark.parametrize(("width", "count"), [(0.85, 1), (0.95, 0)])
def test_who_is_seen_has_a_radius_of_three_of_the_robots(width: float, count: int) -> None:
    assert found(width) == count


def test_three_hits_are_somebody() -> None:
    assert [found(width) for width in (0.03, 0.05)] == [0, 1]


@pytest.mark.parametrize(("apart", "one"), [(0.145, True), (0.155, False)])
def test_a_step_of_a_radius_separates_two_things(apart: float, one: bool) -> None:
    # boards one behind the other, across neighbouring beams
    ranges = np.full(41, np.inf)
    ranges[16:20], ranges[20:24] = 2.0, 2.0 + apart
    tracker = ObstacleTracker(DT)
    tracker.see(scan(ranges, 0.005), np.zeros(3))
    # the far one is partly hidden by the near one, and no cluster of its own
    assert len(tracker.tracks) == 1
    assert bool(tracker.tracks.radii[0] > 0.05) is one


def walking(velocity: tuple[float, float], times: int, radius: float) -> int:
    """How many are somebody in the last of scans of who walks and comes 2 m ahead of it."""
    angles, tracker, here = 0.01 * (np.arange(201) - 100), ObstacleTracker(DT), np.zeros(3)
    for k in range(times):
        place = np.array([2.0, 0.0]) + DT * (k + 1 - times) * np.array(velocity)
        ranges = World(np.array([[*place, radius, 0.0, 0.0]]), np.empty((0, 4))).ranges(
            here[:2], angles
        )
        people = tracker.see(scan(np.where(ranges < 9.0, ranges, np.inf), 0.01), here)
    return len(people)


@pytest.mark.parametrize(("speed", "walks"), [(0.76, 0), (0.84, 1)])
def test_somebody_moves_by_half_of_his_radius_in_a_second(speed: float, walks: int) -> None:
    tracker = walked(speed, 40, radius=1.6)
    tracker.tracks.rows[:, WALKED] = 0.9  # seen to leave his place, just so, and hidden now
    assert len(tracker.see(scan(np.full(41, np.inf), 0.01), np.zeros(3))) == walks


def test_somebody_has_left_his_place_for_three_tenths_of_a_second() -> None:
    assert [walking((0.0, 0.8), times, 0.2) for times in (5, 6)] == [0, 1]
