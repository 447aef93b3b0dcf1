"""The fit that knows space: the constrained least squares, exact recovery, and what it refuses."""

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.learn.regression import symmetric_generator
from kmpc_lite.model.symmetric import find_trigonometry

TRIG = kl.HermiteTrigDictionary(0)
DICTIONARIES = [
    kl.UnicycleDictionary(),
    TRIG,
    kl.HermiteTrigDictionary(1),
    kl.InputHistoryDictionary(TRIG, lags=(0, 2), product=True),
]


def drives(slip: float = 0.05, seed: int = 0) -> kl.Dataset:
    """Random driving, as the paper trains."""
    robot = kmpc_lab.DifferentialDrive(slip, seed, turning_point=(0.05, -0.02))
    return kmpc_lab.generate_dataset(robot, episodes=20, steps=60, dt=0.1, seed=seed)


def rotated(data: kl.Dataset, angle: float, shift: tuple[float, float]) -> kl.Dataset:
    """The same drives, seen from elsewhere."""
    cos, sin = np.cos(angle), np.sin(angle)
    episodes = []
    for e in data.episodes:
        x, y, theta = e.states.T
        states = np.stack(
            [cos * x - sin * y + shift[0], sin * x + cos * y + shift[1], theta + angle], axis=1
        )
        episodes.append(kl.Episode(states, e.inputs, e.dt))
    return kl.Dataset(episodes)


@pytest.mark.parametrize("dictionary", DICTIONARIES)
def test_the_closed_form_is_the_constrained_least_squares(dictionary: kl.Dictionary) -> None:
    data = drives()
    accumulator = kl.Accumulator(dictionary, data.dt)
    accumulator.add(data)
    model = accumulator.solve()
    place = find_trigonometry(dictionary)
    assert place is not None
    # the same rows and targets, written out: one regressor a column of (a, b)
    position, moved, turning, turned = [], [], [], []
    for part in data.transitions(dictionary.history):
        w = dictionary.inputs(part.u, part.history)
        ends = dictionary.lift(part.x), dictionary.lift(part.x_next)
        mean = (ends[0] + ends[1] + 4 * dictionary.lift(0.5 * (part.x + part.x_next))) / 6
        cos, sin = mean[:, place.cos, None], mean[:, place.sin, None]
        position += [np.hstack([cos * w, -sin * w]), np.hstack([sin * w, cos * w])]
        speed = (part.x_next - part.x) / data.dt
        moved += [speed[:, 0], speed[:, 1]]
        turning, turned = [*turning, w], [*turned, speed[:, 2]]
    rows = np.linalg.lstsq(np.concatenate(position), np.concatenate(moved), rcond=None)[0]
    heading = np.linalg.lstsq(np.concatenate(turning), np.concatenate(turned), rcond=None)[0]
    expected = symmetric_generator(dictionary, *np.split(rows, 2), heading)
    np.testing.assert_allclose(model.H, expected, atol=1e-9)
    assert not model.A.any() and not model.B.any()
    assert model.info["symmetric"] and model.info["rank"] == dictionary.input_size


@pytest.mark.parametrize("dictionary", DICTIONARIES)
def test_it_knows_neither_place_nor_heading_and_stands_still(dictionary: kl.Dictionary) -> None:
    data = drives()
    here, there = kl.fit(data, dictionary), kl.fit(rotated(data, 2.0, (40.0, -90.0)), dictionary)
    np.testing.assert_allclose(there.H, here.H, atol=1e-8)
    for part, other in zip(here.noise([0.4, 0.3]), there.noise([0.4, 0.3]), strict=True):
        np.testing.assert_allclose(part, other, atol=1e-9)
    poses = np.random.default_rng(1).uniform(-50.0, 50.0, (30, 3))
    rest = here.predict(poses, np.zeros((30, 2)), np.zeros((30, here.history, 2)))
    np.testing.assert_array_equal(rest, poses)


def test_a_robot_with_a_turning_centre_and_a_bent_mount_is_recovered() -> None:
    along, across, heading = np.array([0.9, 0.03]), np.array([0.05, -0.1]), np.array([0.02, 0.6])
    truth = kl.KoopmanModel(
        TRIG,
        0.1,
        np.zeros((3, 3)),
        np.zeros((3, 2)),
        symmetric_generator(TRIG, along, across, heading),
        np.eye(3),
        continuous=True,
    )
    random = np.random.default_rng(2)
    inputs = random.uniform(-1.0, 1.0, (10, 50, 2))
    states = truth.rollout(random.uniform(-1.0, 1.0, (10, 3)), inputs)
    data = kl.Dataset([kl.Episode(x, u, 0.1) for x, u in zip(states, inputs, strict=True)])
    np.testing.assert_allclose(kl.fit(data, TRIG).H, truth.H, atol=1e-6)


def test_what_cannot_be_symmetric_is_refused_or_free() -> None:
    data = drives()
    planar = kl.HermiteTrigDictionary(1, harmonics=0)
    with pytest.raises(kl.DataError, match=r"holds 1, cos\(theta\) and sin\(theta\), got \(1, He1"):
        kl.fit(data, planar, symmetric=True)
    with pytest.raises(kl.DataError, match="goes with method 'integral'; 'edmdc' is the paper"):
        kl.fit(data, method="edmdc", symmetric=True)
    assert "symmetric" not in kl.fit(data, planar).info
    assert "symmetric" not in kl.fit(data, method="edmdc").info
    assert "symmetric" not in kl.fit(data, symmetric=False).info


@pytest.mark.parametrize(
    ("scale", "mix", "words"),
    [
        ([1, 1, 1], [[1, 2], [0, 0]], "does not excite the model: rank 1 of 2"),
        ([0, 0, 1], [[1, 0], [0, 1]], "the position never changes"),
        ([1, 1, 0], [[1, 0], [0, 1]], "theta never changes"),
    ],
)
def test_logs_that_cannot_show_it_are_reported(scale: list[int], mix: list[list[int]], words: str):
    episodes = [kl.Episode(e.states * scale, e.inputs @ mix, e.dt) for e in drives().episodes]
    with pytest.raises(kl.DataError, match=words):
        kl.fit(kl.Dataset(episodes))
