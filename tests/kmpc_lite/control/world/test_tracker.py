"""Circles without velocity get the one that they were seen to have."""

import numpy as np
import pytest

from kmpc_lite.control.options import TrackerOptions
from kmpc_lite.control.world import tracks
from kmpc_lite.geometry import rotate
from kmpc_lite.scale import UNIT_RADIUS, UNIT_SPEED
from kmpc_lite.types import Array

DT = 0.1


class Tracker:
    """Tracks of a follower, from period to period."""

    def __init__(self, follower: tracks.Follower | None = None) -> None:
        self.follower = follower or tracks.Follower(DT, TrackerOptions(), UNIT_RADIUS, UNIT_SPEED)
        self.tracks = tracks.Tracks()

    def follow(self, circles: Array) -> Array:
        self.tracks, found = self.follower.follow(self.tracks, circles)
        return found


def walk(start: Array, velocity: Array, steps: int, turn_rate: float = 0.0) -> Array:
    """Places (steps, 2) of a pedestrian that walks."""
    places, heading = [np.array(start, dtype=float)], 0.0
    for _ in range(steps - 1):
        step = np.array(rotate(velocity[0], velocity[1], heading))
        places.append(places[-1] + DT * step)
        heading += DT * turn_rate
    return np.array(places)


def rows(*places: Array) -> Array:
    return np.array([[*place, 0.2, 0.0, 0.0] for place in places])


@pytest.mark.parametrize("speed", [0.3, 0.6, 1.0, 1.5])
@pytest.mark.parametrize("seed", range(5))
def test_a_walk_is_noticed_within_half_a_second(speed: float, seed: int) -> None:
    random, tracker = np.random.default_rng(seed), Tracker()
    heading = random.uniform(-np.pi, np.pi)
    velocity = speed * np.array([np.cos(heading), np.sin(heading)])
    for place in walk(random.uniform(-3.0, 3.0, 2), velocity, 6):
        tracker.follow(rows(place + 0.005 * random.normal(size=2)))
    assert tracker.tracks.moving[0]
    error = np.hypot(*(tracker.tracks.velocities[0] - velocity))
    assert error <= 3.0 * tracker.tracks.velocity_deviations[0] <= 0.5


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.02])
def test_a_standing_circle_is_left_standing_whatever_the_noise(noise: float) -> None:
    random, tracker = np.random.default_rng(3), Tracker()
    moved = 0
    for _ in range(300):
        tracker.follow(rows(noise * random.normal(size=2)))
        moved += bool(tracker.tracks.moving[0])
    assert moved <= 2


def test_tracks_that_cross_keep_their_names_whatever_their_order() -> None:
    random, tracker = np.random.default_rng(0), Tracker()
    first = walk(np.array([-1.0, -0.05]), np.array([0.8, 0.0]), 30)
    second = walk(np.array([0.05, -1.0]), np.array([0.0, 0.8]), 30)
    names: list[list[int]] = []
    for a, b in zip(first, second, strict=True):
        order = random.permutation(2)
        seen = rows(a, b)[order] + 0.005 * random.normal(size=(2, 5)) * (1, 1, 0, 0, 0)
        pairs = tracker.follow(seen)
        names.append(tracker.tracks.numbers[pairs][np.argsort(order)].tolist())
    assert all(pair == names[0] for pair in names)


def test_a_track_hidden_for_a_second_is_expected_where_it_comes_out() -> None:
    tracker, places = Tracker(), walk(np.zeros(2), np.array([0.8, 0.2]), 40)
    for place in places[:15]:
        tracker.follow(rows(place))
    name = tracker.tracks.numbers[0]
    for place in places[15:25]:
        tracker.follow(np.empty((0, 5)))
        assert np.hypot(*(tracker.tracks.circles[0, :2] - place)) < 0.1
    tracker.follow(rows(places[25]))
    assert tracker.tracks.numbers.tolist() == [name]
    assert tracker.tracks.moving[0]


def test_the_same_walk_elsewhere_turned_and_scaled_is_the_same_track(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    random = np.random.default_rng(1)
    seen = walk(np.array([0.3, -0.2]), np.array([0.7, 0.1]), 30, 0.3)
    seen = seen + 0.01 * random.normal(size=seen.shape)
    turn, length, time = 2.0, 4.0, 2.0
    tracker = Tracker()
    # what is given in seconds is given in its own
    monkeypatch.setattr(tracks, "TURN_MEMORY", 4.0)
    monkeypatch.setattr(tracks, "TURN_RATE", 0.25)
    slower = TrackerOptions(acceleration=1 / 3)
    other = Tracker(tracks.Follower(DT * time, slower, 0.6, 1.2))
    for place in seen:
        tracker.follow(rows(place))
        turned = length * np.array(rotate(place[0], place[1], turn)) + (10.0, -20.0)
        other.follow(rows(turned))
        assert tracker.tracks.moving.tolist() == other.tracks.moving.tolist()
    vx, vy = tracker.tracks.states[0, 2:4]
    expected = length / time * np.array(rotate(vx, vy, turn))
    np.testing.assert_allclose(other.tracks.states[0, 2:4], expected, rtol=1e-6)


@pytest.mark.parametrize("speed", [0.5, 1.0])
def test_a_circle_that_turns_back_is_followed_from_the_next_measurement_on(speed: float) -> None:
    tracker = Tracker()
    for k in range(15):
        tracker.follow(rows((speed * DT * k, 0.0)))
    there = speed * DT * 14
    for k in range(1, 4):
        tracker.follow(rows((there - speed * DT * k, 0.0)))
    assert tracker.tracks.numbers.tolist() == [0]
    assert tracker.tracks.velocities[0, 0] == pytest.approx(-speed, abs=0.6 * speed)
