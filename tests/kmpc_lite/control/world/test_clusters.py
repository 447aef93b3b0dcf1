"""Small things that stand free in a scan become circles, and who walks among them is found."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.kernels.tracks import MOVING, WALKED
from kmpc_lite.control.options import SightOptions
from kmpc_lite.control.world.sight.sight import Sight
from kmpc_lite.control.world.tracker import ObstacleTracker
from kmpc_lite.control.world.tracking import Tracking
from kmpc_lite.control.world.tracks import TrackedCircles
from kmpc_lite.control.world.walkers import clusters, walking_tracks
from kmpc_lite.scale import Scale
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


def test_a_thing_across_the_ends_of_the_ring_is_one() -> None:
    post = np.array([[1.0, 0.0, 0.2, 0.0, 0.0]])
    assert len(clusters(look(post, np.zeros(3)), np.zeros(3), 0.15)) == 1


def test_what_is_partly_hidden_is_no_cluster() -> None:
    row = np.array([[1.0, 0.0, 0.2, 0.0, 0.0], [2.0, 0.35, 0.2, 0.0, 0.0]])
    found = clusters(look(row, np.zeros(3)), np.zeros(3), 0.15)
    assert len(found) == 1 and found[0, 0] < 1.1


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


def test_posts_do_not_walk_when_a_robot_drives_by() -> None:
    random, tracker, pose, walking = np.random.default_rng(3), ObstacleTracker(DT), np.zeros(3), 0
    for _ in range(60):
        walking += len(tracker.see(look(POSTS, pose, random), pose))
        pose = pose + (0.03, 0.0, 0.01)
    assert walking <= 3


def test_pieces_of_walls_do_not_walk_when_a_robot_drives_by() -> None:
    random, tracker, walking = np.random.default_rng(4), ObstacleTracker(DT), 0
    walls = np.array([[0.4 * k, 0.8, 0.4 * k + 0.25, 0.8] for k in range(-3, 12)])
    for k in range(60):
        pose = np.array([0.05 * k, 0.1 * math.sin(0.1 * k), 0.02 * k])
        walking += len(tracker.see(look(POSTS, pose, random, walls), pose))
    assert walking <= 3


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
def test_who_comes_to_where_it_was_free_may_walk_though_somebody_is_where_he_was(
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


def test_a_wall_that_goes_on_beyond_the_scanners_reach_is_none() -> None:
    walls = np.array([[0.98 * REACH, -9.0, 0.98 * REACH, 9.0]])
    scan = look(np.empty((0, 5)), np.zeros(3), walls=walls)
    assert scan.hits.any() and not len(clusters(scan, np.zeros(3), 0.15, 20.0))


def test_a_pose_of_another_shape_is_refused() -> None:
    with pytest.raises(ValueError, match="expected shape"):
        ObstacleTracker(DT).see(look(POSTS, np.zeros(3)), (0.0, 0.0))


@pytest.mark.parametrize("width", [0.6, 0.8])
def test_the_walls_of_a_corridor_around_the_robot_are_no_cluster(width: float) -> None:
    """Their hits are one run that leads around behind the robot; its ends are a width apart."""
    half = 0.5 * width
    walls = np.array([[-3.0, -half, 8.0, -half], [-3.0, half, 8.0, half]])
    ends = np.array([[-3.0, -half, -3.0, half]])
    post = np.array([[1.0, 0.0, 0.05, 0.0, 0.0]])
    for x in (0.0, 0.2, 0.4):
        pose = np.array([x, 0.0, 0.0])
        nobody = look(np.empty((0, 5)), pose, walls=np.concatenate([walls, ends]))
        assert not len(clusters(nobody, pose, 0.15))
        found = clusters(look(post, pose, walls=np.concatenate([walls, ends])), pose, 0.15)
        assert len(found) == 1 and found[0, :3] == pytest.approx(post[0, :3], abs=0.03)


@pytest.mark.parametrize("age", [0.1, 0.2])
def test_posts_do_not_walk_when_scans_of_a_robot_that_turns_are_old(age: float) -> None:
    posts, walkers, count = np.append(POSTS, [[-1.0, 1.5, 0.1, 0.0, 0.0]], axis=0), 0, 100
    times = DT * np.arange(count) - np.array([[0.0], [age]])
    # to and fro, by 0.2 rad each way
    headings = 0.2 * np.arcsin(np.sin(math.tau * times))
    problem = kl.NavigationProblem(x_min=(-6, -6, -np.inf), x_max=(6, 6, np.inf))
    eyes, map_ = Sight(problem, Scale(), SightOptions(), 1.65), None
    watch, state = Tracking(problem, kl.ControllerOptions()), TrackedCircles()
    random = np.random.default_rng(0)
    for now, then in headings.T:
        pose, fresh = np.array([0.0, 0.0, now]), look(posts, np.array([0.0, 0.0, then]), random)
        scan = dataclasses.replace(fresh, age=age)
        around = watch.see(state, np.empty((0, 7)), [scan], pose, map_)
        map_ = eyes.look(map_, [scan], pose, 0.0)
        walkers += around.walking
    assert walkers < 5
