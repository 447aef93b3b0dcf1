"""Short and poor logs: a lag is found early, and what they do not show is not held against them."""

from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite.learn.learning import Learned, learn
from kmpc_lite.learn.selection import learned_axes, select
from kmpc_lite.model.file import Ramps

ROVER = Path(__file__).parents[4] / "shared" / "data" / "rover_sitl"
NOISE = (0.002, 0.002, 0.004)
real = pytest.mark.skipif(not ROVER.is_dir(), reason="needs ../shared/data/rover_sitl")


def late_log(seconds: int, seed: int, lag: float = 0.1, dead_time: float = 0.1) -> kl.Dataset:
    """One drive of a robot that answers late and does not slip."""
    robot = LaggingDrive(lag, dead_time, 0.0, seed=seed)
    return drive_log(robot, 1, 10 * seconds, 0.1, seed, hold=7, pose_noise=NOISE)


def piece(log: kl.Dataset, begin: int, end: int) -> kl.Dataset:
    """Rows of a log of one episode."""
    (whole,) = log.episodes
    states, inputs = whole.states[begin : end + 1], whole.inputs[begin:end]
    return kl.Dataset([kl.Episode(states, inputs, whole.dt)])


def rover(name: str) -> kl.Dataset:
    """A log of the rover."""
    return kl.Dataset.load(ROVER / f"{name}.csv", dt=0.1)


@real
@pytest.mark.parametrize(("begin", "end"), [(0, 200), (300, 600), (450, 900), (0, 914)])
@pytest.mark.parametrize("name", ["quiet", "busy"])
def test_the_rovers_lag_is_in_every_part_of_its_logs(name: str, begin: int, end: int) -> None:
    assert select(piece(rover(name), begin, end)).speed.delay == pytest.approx(0.2, abs=0.05)


@pytest.fixture(scope="module")
def hopeless() -> Learned:
    """Ten seconds, of which half is learned from, with poses to 5 cm."""
    robot = LaggingDrive(0.1, 0.1, 0.0, seed=5)
    noise = (0.05, 0.05, 0.1)
    return learn(drive_log(robot, 1, 100, 0.1, 5, hold=7, pose_noise=noise), [Path("short.csv")])


def test_a_hopeless_log_makes_the_nominal_model(hopeless: Learned) -> None:
    model, nominal = hopeless.model, kl.nominal_unicycle(0.1)
    assert not learned_axes(model).any()
    # lags that it hides would be taken for noise, and its gentle starts for the robot's limits
    assert model.noise_model is None
    assert not Ramps.of(model.info, "changes").limit
    commands = np.array([[0.3, 0.2]] * 10)
    moved = model.rollout(np.zeros(3), commands)
    np.testing.assert_allclose(moved, nominal.rollout(np.zeros(3), commands), atol=1e-12)
    assert "too few" in hopeless.uncalibrated
