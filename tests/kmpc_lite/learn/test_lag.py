"""How late robots answer is found at any period, of any commands, or said to be ambiguous."""

from dataclasses import replace

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.plants.lag import LaggingDrive
from kmpc_lab.studies.any_robot import Robot, record
from kmpc_lite.learn.lag import find_response, mean_delay
from kmpc_lite.types import Array


def asked(kind: str, count: int, dt: float, random: np.random.Generator) -> Array:
    """Commands (T, 2) that swing, that jump, or that a hand gives."""
    times = np.arange(count) * dt
    if kind == "periodic":
        first, second = random.uniform(3.0, 8.0, 2)
        v = 0.6 + 0.4 * np.sin(2 * np.pi * times / first)
        return np.column_stack([v, np.sin(2 * np.pi * times / second)])
    aims, held = random.uniform((-0.5, -1.0), 1.0, (count, 2)), random.uniform(0.5, 2.5, count)
    jumps = aims[np.searchsorted(np.cumsum(held), times)]
    if kind == "jumps":
        return jumps
    hand = np.zeros((count, 2))
    for k in range(1, count):
        hand[k] = hand[k - 1] + (jumps[k] - hand[k - 1]) * min(1.0, dt / 0.2)
    return hand


def drive(kind: str, dead: float, lag: float, rate: float, seed: int) -> kl.Dataset:
    """Two and a half minutes of a robot that answers so late [s], logged at a rate [Hz]."""
    random, dt = np.random.default_rng(seed), 1.0 / rate
    told, robot = asked(kind, round(150.0 * rate), dt, random), LaggingDrive(lag, dead)
    poses = [np.zeros(3)]
    for command in told:
        poses.append(robot.step(poses[-1], command, dt))
    noisy = np.array(poses) + random.normal(size=(len(poses), 3)) * (0.003, 0.003, 0.004)
    data = kl.Dataset([kl.Episode(noisy, told, dt)])
    return data.resample(0.05) if dt < 0.05 else data


def is_told(seed: int) -> bool:
    """Whether the lags of a robot that is drawn are found, or said to be ambiguous."""
    random, kind = np.random.default_rng(seed), ("periodic", "jumps", "hand")[seed % 3]
    dead, lag = random.uniform(0.0, 0.8), random.uniform(0.05, 0.5)
    rate = float(random.choice((10, 12.5, 20, 25, 50)))
    data = drive(kind, dead, lag, rate, seed)
    for axis in range(2):
        found = find_response(data, [axis])
        off = abs(found.response.dead_time - dead), abs(found.response.time_constant - lag)
        if not found.sure or not (found.doubt or (off[0] <= data.dt and off[1] <= 0.25 * lag)):
            return False
    return True


@pytest.mark.parametrize("seed", range(6))
def test_dead_time_and_time_constant_are_told_apart_or_are_said_not_to_be(seed: int) -> None:
    assert is_told(seed)


@pytest.mark.long
def test_of_forty_robots_nineteen_of_twenty_are_told() -> None:
    assert sum(map(is_told, range(100, 140))) >= 38


def test_a_robot_that_obeys_at_once_has_none_however_noisy_its_poses_are():
    for seed in range(5):
        robot = Robot("prompt", noise=(0.02, 0.05), seconds=60.0)
        assert mean_delay(record(robot, seed)) == 0.0


def test_the_delay_is_kept_in_the_file_and_a_nonsensical_one_is_refused(tmp_path):
    model = kl.fit(record(Robot("late", lag=0.2), 4))
    path = tmp_path / "robot.npz"
    model.save(path)
    read = kl.KoopmanModel.load(path)
    assert read.info["unmodelled_delay"] == model.info["unmodelled_delay"] > 0.1
    replace(model, info={"unmodelled_delay": -1.0}).save(path)
    with pytest.raises(kl.ModelError, match="unmodelled_delay: expected a time"):
        kl.KoopmanModel.load(path)


def test_margins_know_that_feedback_acts_later_in_any_units():
    from kmpc_lite.control.kernels.predictor import motion_in_units
    from kmpc_lite.model.tube import feedback_delay
    from kmpc_lite.scale import Scale

    model = kl.fit(record(Robot("late", lag=0.2, dead_time=0.1), 4))
    assert feedback_delay(model) == round(model.info["unmodelled_delay"] / model.dt) > 1
    assert feedback_delay(motion_in_units(model, Scale(3.0, 2.0))) == feedback_delay(model)
