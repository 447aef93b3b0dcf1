"""Short and poor logs: a lag is found early, and what they do not show is not held against them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from public_cases import case

import kmpc_lite as kl
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite.learn.evaluation import FitReport
from kmpc_lite.learn.learning import Learned, learn
from kmpc_lite.learn.loading import load_logs
from kmpc_lite.learn.selection import learned_axes, select
from kmpc_lite.learn.verdict import verdict
from kmpc_lite.model.file import Ramps

ROVER = Path(__file__).parents[4] / "shared" / "data" / "rover_sitl"
NOISE = (0.002, 0.002, 0.004)
real = pytest.mark.skipif(not ROVER.is_dir(), reason="needs ../shared/data/rover_sitl")


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


def circles(speed: float, turn: float, seed: int) -> kl.Dataset:
    """A log of circles at one speed, which tells neither speed from turn nor a lag from a gain."""
    random, dt, pose = np.random.default_rng(seed), 0.1, np.zeros(3)
    commands = np.array((speed, turn)) * (1.0 + 0.01 * random.normal(size=(600, 2)))
    seen = []
    for command in commands:
        seen.append(pose + random.normal(size=3) * (0.005, 0.005, 0.017))
        pose = kl.nominal_unicycle(dt).predict(pose, command)
    seen.append(pose)
    return kl.Dataset([kl.Episode(np.array(seen), commands, dt)])


def assert_never_worse(learned) -> None:
    report = learned.report
    for ours, theirs in zip(report.multi_step, report.nominal_multi_step, strict=True):
        assert ours <= 1.25 * theirs


@pytest.mark.parametrize("name", ["circles_1", "car_circles_1"])
def test_a_log_of_circles_is_not_fitted_by_its_noise(name: str) -> None:
    assert_never_worse(learn(load_logs([path := case(f"logs/{name}.csv")]), [path]))


@pytest.mark.parametrize("seed", range(3))
def test_siblings_of_it_are_not_either(seed: int) -> None:
    assert_never_worse(learn(circles(0.5 + 0.3 * seed, 0.6, seed), [Path("log")]))


def test_the_verdict_says_that_it_stays_nominal_and_what_is_missing() -> None:
    learned = learn(load_logs([path := case("logs/circles_1.csv")]), [path])
    words = verdict(learned.report, learned.facts, learned.made["driven"])
    assert words.startswith("As nominal: the log supports no better") and "left turns" in words
    assert learned.model.info["selection"]["directions"]["heading"]["step"] == "nominal"


@pytest.mark.parametrize("on_the_spot", [False, True])
def test_a_differential_robots_log_with_a_steering_column_is_no_cars(
    tmp_path: Path, on_the_spot: bool
) -> None:
    random, dt, pose, rows = np.random.default_rng(3), 0.05, np.zeros(3), []
    for k in range(1200):
        if k % 30 == 0:
            still = on_the_spot and random.random() < 0.5
            command = random.uniform(-1, 1, 2) * (0.0 if still else 0.8, 1.2)
            steering = float(np.arctan2(2.5 * command[1], abs(command[0]) + 1.0))
        rows.append((k * dt, *pose, command[0], steering if on_the_spot else random.uniform(-1, 1)))
        pose = kl.nominal_unicycle(dt).predict(pose, command)
    path = tmp_path / "log.csv"
    head = "t,x,y,theta,v,steering"
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    with pytest.raises(kl.DataError, match="steering: the robot turns (otherwise|where it stands)"):
        load_logs([path], None, None, None, lambda line: None)


NOMINAL = (0.05, 0.02, 0.01)
DRIVEN = {"forward": 1.1, "reverse": 0.4, "turn": 0.8}


def report(*ratios: float) -> FitReport:
    """Errors that are so many times smaller than the nominal robot's."""
    ours = tuple(n / r for n, r in zip(NOMINAL, ratios, strict=True))
    return FitReport(1.0, 100, ours, ours, NOMINAL, NOMINAL, 0.1)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("ratios", "told"),
    [
        ((1.0, 1.2, 5.0), "Good: predicts 5 times better than nominal in heading;"),
        ((1.0, 1.0, 1.0), "As nominal: the log supports no better prediction;"),
        ((0.5, 1.0, 1.0), "Poor: predicts 2 times worse along than nominal;"),
        ((0.5, 1.0, 3.0), "Mixed: predicts 3 times better than nominal in heading but 2 times"),
    ],
)
def test_the_verdict_compares_with_the_nominal_robot(ratios: tuple[float, ...], told: str) -> None:
    line = verdict(report(*ratios), {}, DRIVEN)
    assert line.startswith(told) and line.endswith("drive up to 1.1 m/s.")
