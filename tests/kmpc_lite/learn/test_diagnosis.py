"""What is reported of a log: frames that are wrong, what it does not show, what its columns are."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite.learn.checks.checklist import refuse_car_like
from kmpc_lite.learn.coverage import find_coverage
from kmpc_lite.learn.diagnosis import diagnose
from kmpc_lite.learn.fit_summary import format_summary, summarize_fit, warn_of_errors
from kmpc_lite.learn.learning import LearningOptions, learn
from kmpc_lite.learn.responses import AT_ONCE

NOISE = np.array([0.005, 0.005, 0.01])
MOSTLY_HELD = LearningOptions(holdout=0.8, seed=1)
Change = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


def find_gaps(data: kl.Dataset) -> list[str]:
    return find_coverage([e.inputs for e in data.episodes], data.dt).warnings()


def log(
    change: Change = lambda x, u: (x, u), seed: int = 0, robot: LaggingDrive | None = None
) -> kl.Dataset:
    """Four minutes of a robot that obeys, poses noisy, changed as given."""
    plant = LaggingDrive(seed=seed) if robot is None else robot
    clean = drive_log(plant, 24, 100, 0.1, seed, hold=10)
    random = np.random.default_rng(seed)
    episodes = []
    for e in clean.episodes:
        states, inputs = change(e.states.copy(), e.inputs.copy())
        episodes.append(kl.Episode(states + random.normal(size=states.shape) * NOISE, inputs, 0.1))
    return kl.Dataset(episodes)


def drifting(x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A slope: 5 cm/s to the north."""
    x[:, 1] += 0.05 * 0.1 * np.arange(len(x))
    return x, u


def compass(x: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A compass that errs by 0.3 sin(theta)."""
    x[:, 2] += 0.3 * np.sin(x[:, 2])
    return x, u


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda x, u: (x * [1, -1, 1], u), "in a mirror"),
        (lambda x, u: (x + [0, 0, np.pi], u), "drives backwards"),
        (lambda x, u: (x, u * [1, -1]), "turns right"),
        (drifting, r"drifts by 0.05 m/s towards \+1.6 rad"),
        (compass, "% larger where theta is"),
    ],
)
def test_a_frame_that_is_wrong_is_reported_with_its_size(change: Change, words: str) -> None:
    told = "; ".join(diagnose(log(change), AT_ONCE, AT_ONCE))
    assert re.search(words, told), told


@pytest.mark.parametrize("seed", range(4))
def test_a_robot_in_order_is_not_accused(seed: int) -> None:
    assert diagnose(log(seed=seed), AT_ONCE, AT_ONCE) == []
    assert find_gaps(log(seed=seed)) == []


def driven(obey: Callable[[np.ndarray], np.ndarray], one_speed: bool = False) -> kl.Dataset:
    """Four minutes of a robot that turns commands (T, 2) into speeds at once."""
    random, episodes = np.random.default_rng(0), []
    for _ in range(24):
        asked = np.repeat(random.uniform(-1.0, 1.0, (10, 2)) * [0.6, 1.2], 10, axis=0)
        if one_speed:
            asked[:, 0] = 0.6
        v, omega = 0.1 * obey(asked).T
        theta = np.concatenate([[0.0], np.cumsum(omega)])
        moved = v * np.sinc(0.5 * omega / np.pi) * np.exp(1j * (theta[:-1] + 0.5 * omega))
        path = np.concatenate([[0.0], np.cumsum(moved)])
        states = np.column_stack([path.real, path.imag, theta])
        episodes.append(kl.Episode(states + random.normal(size=states.shape) * NOISE, asked, 0.1))
    return kl.Dataset(episodes)


@pytest.mark.parametrize(
    ("gain", "words"),
    [
        ((0.6, 1.0), r"drives forward at 1.00 of its command, and reverses at 0.(59|60|61)"),
        ((1.0, 0.6), r"turns left at (0.99|1.00|1.01) of its command, and right at 0.(59|60|61)"),
    ],
)
def test_a_gain_that_differs_by_side_is_reported_and_is_no_creep(
    gain: tuple[float, float], words: str
) -> None:
    data = driven(lambda u: np.where(u < 0.0, u * gain, u))
    told = diagnose(data, AT_ONCE, AT_ONCE)
    assert len(told) == 1 and re.search(words, told[0]), told


def test_a_creep_is_reported_only_of_a_log_that_can_show_it() -> None:
    at_rest = "; ".join(diagnose(driven(lambda u: u + [0.05, 0.1]), AT_ONCE, AT_ONCE))
    assert "0.05 m/s at zero command" in at_rest and "0.1 rad/s at zero command" in at_rest
    assert diagnose(driven(lambda u: u, one_speed=True), AT_ONCE, AT_ONCE) == []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda x, u: (x, np.abs(u) * [1, 0] + u * [0, 1]), "never reverses"),
        (lambda x, u: (x, np.abs(u) * [0, 1] + u * [1, 0]), "never turns right"),
        (lambda x, u: (x, -np.abs(u) * [0, 1] + u * [1, 0]), "never turns left"),
        (lambda x, u: (x, np.sign(u) * [0.5, 0] + u * [0, 1]), "never drives slowly"),
        (lambda x, u: (x, np.sign(u) * [0.5, 0] + u * [0, 1]), "never turns on the spot"),
    ],
)
def test_what_a_log_does_not_show_is_reported(change: Change, words: str) -> None:
    assert any(words in line for line in find_gaps(log(change)))


def test_a_car_is_refused_and_a_robot_that_turns_less_is_not() -> None:
    random = np.random.default_rng(1)

    def drive(car: bool) -> kl.Dataset:
        episodes = []
        for _ in range(12):
            inputs = np.repeat(random.uniform(-1.0, 1.0, (8, 2)), 20, axis=0)
            inputs[::3] = inputs[::3]
            inputs[40:100, 0] = 0.0
            x, states = np.zeros(3), [np.zeros(3)]
            for v, omega in inputs:
                turn = (0.0 if car and abs(v) < 0.05 else 0.6) * omega * 0.1
                x = x + [0.1 * v * np.cos(x[2]), 0.1 * v * np.sin(x[2]), turn]
                states.append(x)
            episodes.append(kl.Episode(np.array(states), inputs, 0.1))
        return kl.Dataset(episodes)

    refuse_car_like(drive(car=False))
    with pytest.raises(kl.DataError, match="does not turn on the spot.*It is a car"):
        refuse_car_like(drive(car=True))
    with pytest.raises(kl.DataError, match="does not turn on the spot"):
        kl.fit(drive(car=True), kl.HermiteTrigDictionary(0), lags="auto")


def test_a_car_commanded_a_few_times_to_turn_on_the_spot_is_refused() -> None:
    """The part of its log that a model is learned from does not show it."""
    random, step, inputs = np.random.default_rng(2), 0.1, np.zeros((1200, 2))
    inputs[:] = np.repeat(random.uniform((0.3, -0.8), (1.0, 0.8), (60, 2)), 20, axis=0)
    for begin in (100, 500, 900):
        inputs[begin : begin + 20] = 0.0, 0.8
    x = np.zeros((1201, 3))
    for k, (v, omega) in enumerate(inputs):
        turn = 0.0 if v == 0.0 else omega
        x[k + 1] = x[k] + step * np.array([v * np.cos(x[k, 2]), v * np.sin(x[k, 2]), turn])
    x += random.normal(size=x.shape) * 0.002
    with pytest.raises(kl.DataError, match="does not turn on the spot"):
        learn(kl.Dataset([kl.Episode(x, inputs, step)]), [Path("car.csv")], MOSTLY_HELD)


def test_the_summary_names_what_the_robot_does() -> None:
    robot = LaggingDrive(0.2, 0.1, 0.0, turn_gain=0.6, seed=3, turning_point=(0.05, -0.02))
    data = log(seed=3, robot=robot)
    train, held = data.split(0.5)
    model = kl.fit(train, kl.HermiteTrigDictionary(0), lags="auto")
    facts = summarize_fit(model, train)
    assert facts["turn_gain"] == pytest.approx(0.6, abs=0.02)
    np.testing.assert_allclose(facts["turning_centre"], (0.05, -0.02), atol=0.01)
    delay = facts["lag"]["speed"]["dead_time"] + facts["lag"]["speed"]["time_constant"]
    assert delay == pytest.approx(0.3, abs=0.04)
    assert facts["braking_distance"] == pytest.approx(delay * facts["largest"]["v"], rel=0.05)
    text = format_summary(facts)
    assert re.search(r"turns 0\.(6|59)", text) and "dead time" in text and "commands (" in text
    assert all(len(line) < 200 for line in text.splitlines())
    assert warn_of_errors(kl.evaluate(model, held)) == []
