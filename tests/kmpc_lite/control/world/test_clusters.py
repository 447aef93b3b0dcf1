"""Small things that stand free in a scan become circles, and what walks among them is found."""

import math

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.kernels.tracks import MOVING, WALKED
from kmpc_lite.control.world.tracker import ObstacleTracker
from kmpc_lite.control.world.walkers import clusters, walking_tracks
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

DT, BEAMS, REACH = 0.1, 360, 4.0
POSTS = np.array(
    [[1.5, 0.8, 0.1, 0.0, 0.0], [1.0, -1.2, 0.2, 0.0, 0.0], [2.4, 0.2, 0.15, 0.0, 0.0]]
)
WALLS = np.array([[-1.0, 2.0, 4.0, 2.0], [-1.0, -2.0, 4.0, -2.0], [-1.0, -2.0, -1.0, 2.0]])


def look(
    circles: Array,
    pose: Array,
    random: np.random.Generator | None = None,
    walls: Array = WALLS,
) -> kl.LaserScan:
    directions = math.tau / BEAMS * np.arange(BEAMS)
    ranges = World(circles, walls).ranges(pose[:2], pose[2] + directions)
    if random is not None:
        ranges = ranges + 0.01 * random.normal(size=BEAMS)
        ranges[random.random(BEAMS) < 0.01] = np.nan
    ranges[ranges > REACH] = np.inf
    return kl.LaserScan(ranges, 0.0, math.tau / BEAMS, REACH)


@pytest.mark.parametrize("turn", [0.0, 1.0, -2.5])
def test_posts_are_circles_where_they_stand_and_walls_are_none(turn: float) -> None:
    pose = np.array([0.1, 0.0, turn])
    found = clusters(look(POSTS, pose), pose, 0.15)
    assert len(found) == len(POSTS)
    for row in found:
        nearest = POSTS[np.hypot(*(POSTS[:, :2] - row[:2]).T).argmin()]
        assert np.hypot(*(row - nearest)[:2]) < 0.05
        assert row[2] == pytest.approx(nearest[2], abs=0.03)


def test_nothing_is_found_in_an_empty_scan() -> None:
    for value in (np.inf, np.nan):
        scan = kl.LaserScan(np.full(BEAMS, value), 0.0, math.tau / BEAMS, REACH)
        assert clusters(scan, np.zeros(3), 0.15).shape == (0, 5)


def test_pedestrians_are_found_among_posts_by_a_robot_that_drives() -> None:
    random, tracker, pose = np.random.default_rng(2), ObstacleTracker(DT), np.zeros(3)
    found, wrong = 0, 0
    for k in range(50):
        walker = np.array([[0.5 + 0.06 * k, 1.2, 0.25, 0.6, 0.0]])
        for circle in tracker.see(look(np.vstack([POSTS, walker]), pose, random), pose):
            is_right = np.hypot(circle.x - walker[0, 0], circle.y - 1.2) < 0.2
            found += is_right and abs(circle.vx - 0.6) < 0.25
            wrong += not is_right
        pose = pose + (0.03, 0.0, 0.02)
    assert found >= 25
    assert wrong <= 5


def test_a_pedestrian_walks_until_nothing_has_confirmed_it_for_a_second() -> None:
    tracker, pose = ObstacleTracker(DT), np.zeros(3)
    for k in range(20):
        scan = look(np.array([[1.2, 0.06 * k - 1.2, 0.25, 0.0, 0.0]]), pose)
        people = tracker.see(scan, pose)
    assert len(people) == 1
    tracks, known = tracker.tracks, []
    for _ in range(15):
        tracks.rows[:, MOVING] = 0.0
        known.append(len(walking_tracks(tracks, tracker._follower, [scan], [pose])[0]))
    assert all(known[:9]) and not any(known[10:])


@pytest.mark.parametrize("free", [True, False])
def test_a_cluster_where_it_was_free_may_walk_though_another_is_where_it_was(
    free: bool,
) -> None:
    tracker, pose = ObstacleTracker(DT), np.zeros(3)
    for k in range(20):
        # one after the other, as far apart as they walk in a second
        scan = look(np.array([[1.2, 0.06 * k - 0.6 * i, 0.2, 0.0, 0.0] for i in (0, 1)]), pose)
        tracker.see(scan, pose)
    tracks, follower = tracker.tracks, tracker._follower
    tracks.rows[:, WALKED] = 0.0
    here = [scan], [pose]
    known, perhaps = walking_tracks(
        tracks, follower, *here, lambda places: np.full(len(places), free)
    )
    assert not len(known)
    assert (tracks.states[perhaps, 1] > 0.8).any() == free


def test_a_pose_of_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match="expected shape"):
        ObstacleTracker(DT).see(look(POSTS, np.zeros(3)), (0.0, 0.0))
