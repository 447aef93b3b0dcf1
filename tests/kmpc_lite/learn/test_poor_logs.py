"""Short and poor logs: a lag is found early, and what they do not show is not held against them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lab.studies.real_robots import RealPlant, real_robot
from kmpc_lab.studies.robot_drives import course_of, judge
from kmpc_lite.learn.learning import Learned, learn
from kmpc_lite.learn.selection import learned_axes, select
from kmpc_lite.model.ramps import Ramps

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


@pytest.mark.parametrize("seed", range(4))
def test_twenty_seconds_show_how_late_a_robot_answers(seed: int) -> None:
    found = select(late_log(20, seed))
    # half a period of the held commands is delay, too, and is in the model already
    assert found.speed.delay == pytest.approx(0.2, abs=0.06)


@pytest.mark.parametrize("seed", range(4))
def test_a_prompt_robot_answers_at_once_in_any_log(seed: int) -> None:
    found = select(late_log(20, seed, lag=0.0, dead_time=0.0))
    assert found.speed.delay == found.turn.delay == 0.0


@real
@pytest.mark.parametrize(("begin", "end"), [(0, 200), (300, 600), (450, 900), (0, 914)])
@pytest.mark.parametrize("name", ["quiet", "busy"])
def test_the_rovers_lag_is_in_every_part_of_its_logs(name: str, begin: int, end: int) -> None:
    assert select(piece(rover(name), begin, end)).speed.delay == pytest.approx(0.2, abs=0.05)


@real
def test_the_log_of_a_busy_recorder_shows_lag_and_braking() -> None:
    learned = learn(rover("busy"), [ROVER / "busy.csv"])
    assert 0.15 < learned.facts["braking_distance"] / learned.facts["largest"]["v"] < 0.25
    # what looks like feeble brakes is lag: commands fall by 1 m/s^2
    assert learned.model.info["stopping"]["deceleration"] > 0.8
    ours, nominal = learned.report.multi_step, learned.report.nominal_multi_step
    assert ours[0] < 0.5 * nominal[0]


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


@real
@pytest.mark.long
def test_no_log_of_the_rover_drives_worse_than_none() -> None:
    """Paired drives on a plant that moves and errs as the quiet log: 21 random maps."""
    robot = real_robot(ROVER / "quiet.csv", 0.25, 0.5, 0.8).robot
    log = rover("quiet")
    truth = kl.fit(log, lags="auto", ramps=False)
    models = {"nominal": kl.nominal_unicycle(0.1)}
    for name, part in {
        "quiet": log,
        "busy": rover("busy"),
        "20 s": piece(rover("busy"), 0, 200),
        "10 s": piece(rover("busy"), 500, 600),
    }.items():
        models[name] = learn(part, [ROVER / "busy.csv"]).model
    times: dict[str, list[float]] = {}
    for name, model in models.items():
        for seed in range(3000, 3021):
            course = course_of(robot, seed)
            controller = kl.Controller(model, robot.problem(course.side))
            row = judge(name, seed, controller, RealPlant(truth, log, seed, 0.0), course)
            assert row.in_pose and not row.collided, row
            times.setdefault(name, []).append(row.seconds)
    for name, taken in times.items():
        assert np.mean(taken) <= 1.03 * np.mean(times["nominal"]), (name, times)
