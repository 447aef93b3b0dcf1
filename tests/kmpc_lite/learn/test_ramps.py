"""Robots that change their speeds by ramps: found in their logs, and driven by them."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab import DifferentialDrive
from kmpc_lite.errors import ModelError
from kmpc_lite.learn import Dataset, Episode, fit, with_quantiles
from kmpc_lite.learn.learning import learn
from kmpc_lite.learn.loading import load_logs
from kmpc_lite.learn.logs import ReadOptions
from kmpc_lite.learn.ramps import find_ramps, shown_changes
from kmpc_lite.model.file import Ramps, check_info
from kmpc_lite.types import Array

DT, PARTS = 0.1, 20
RAMPS = Ramps(np.array((0.4, 2.0)), np.array((0.8, 2.0)))
NONE = Ramps(np.full(2, np.inf), np.full(2, np.inf))


class RampedRobot:
    """A robot of 1 m/s: a ramp, then a lag; its commands act after a dead time of a period."""

    def __init__(self, pose: Array, ramps: Ramps = RAMPS, lag: float = 0.1) -> None:
        self.pose, self._ramps, self._lag = np.array(pose, dtype=float), ramps, lag
        self._aim, self.speed, self._told = np.zeros(2), np.zeros(2), np.zeros(2)

    def drive(self, command: Array) -> Array:
        """Poses (PARTS, 3) of a period."""
        h, poses = DT / PARTS, []
        told, self._told = self._told, np.asarray(command, dtype=float)
        for _ in range(PARTS):
            slows = (np.abs(told) < np.abs(self._aim)) | (told * self._aim < 0.0)
            most = h * np.where(slows, self._ramps.slower, self._ramps.faster)
            self._aim = self._aim + np.clip(told - self._aim, -most, most)
            self.speed += (self._aim - self.speed) * min(h / self._lag, 1.0)
            v, omega = self.speed
            self.pose += h * np.array((v * np.cos(self.pose[2]), v * np.sin(self.pose[2]), omega))
            poses.append(self.pose.copy())
        return np.array(poses)


def drive_by_hand(ramps: Ramps = RAMPS, lag: float = 0.1, seconds: float = 120.0) -> Dataset:
    """A log of commands held for a second or two."""
    random, robot = np.random.default_rng(3), RampedRobot(np.zeros(3), ramps, lag)
    commands: list[Array] = []
    while len(commands) < seconds / DT:
        kind = random.random()
        command = random.uniform((-0.5, -1.0), (1.0, 1.0)) * (kind > 0.15, kind > 0.3)
        commands += [command] * int(random.integers(8, 25))
    poses = [robot.pose.copy(), *(robot.drive(command)[-1] for command in commands)]
    noisy = np.array(poses) + random.normal(size=(len(poses), 3)) * (0.005, 0.005, 0.005)
    return Dataset([Episode(noisy, np.array(commands), DT)])


@pytest.fixture(scope="module")
def log() -> Dataset:
    return drive_by_hand()


def test_ramps_are_found_in_a_log_of_driving_by_hand(log: Dataset) -> None:
    found = find_ramps(log)
    np.testing.assert_allclose(found.faster, RAMPS.faster, rtol=0.15)
    np.testing.assert_allclose(found.slower, RAMPS.slower, rtol=0.15)


def test_ramps_of_more_than_ten_seconds_are_found() -> None:
    """If a log drives on for so long: no constant tells how slow a robot may be."""
    slow = Ramps(np.array((0.08, 2.0)), np.array((0.08, 2.0)))
    found = find_ramps(drive_by_hand(slow, seconds=240.0))
    np.testing.assert_allclose(found.faster, slow.faster, rtol=0.15)
    np.testing.assert_allclose(found.slower, slow.slower, rtol=0.15)


@pytest.mark.parametrize("lag", [0.02, 0.3, 0.5])
def test_a_lag_is_no_ramp(lag: float) -> None:
    assert not find_ramps(drive_by_hand(NONE, lag)).limit


def test_a_model_reports_the_ramps_of_its_robot_and_predicts_it(log: Dataset) -> None:
    train, held = (Dataset([e]) for e in _halves(log))
    model = with_quantiles(fit(train, lags="auto"), held)
    assert Ramps.of(model.info).limit
    errors = kl.evaluate(model, held, 1.0).multi_step
    without = fit(train, lags="auto", ramps=False)
    assert not Ramps.of(without.info).limit
    # positions are measured to 5 mm, at both ends
    assert errors[0] < 0.012 < 0.05 < kl.evaluate(without, held, 1.0).multi_step[0]


def _halves(log: Dataset) -> list[Episode]:
    (whole,) = log.episodes
    k = len(whole) // 2
    first = Episode(whole.states[: k + 1], whole.inputs[:k], DT)
    return [first, Episode(whole.states[k:], whole.inputs[k:], DT)]


def test_the_controller_asks_for_no_faster_changes() -> None:
    info = {"ramps": Ramps(np.array((0.4, np.inf)), np.array((0.8, 3.0))).as_dict()}
    model = dataclasses.replace(kl.nominal_unicycle(DT), info=info)
    problem = kl.Controller(model, kl.NavigationProblem(du_max=(0.6, 9.0))).problem
    np.testing.assert_allclose(problem.du_max, (0.4, 3.0))
    np.testing.assert_allclose(problem.deceleration, (0.8, 3.0))
    own = kl.NavigationProblem(du_max=(0.2, 1.0), deceleration=(0.5, 1.0))
    kept = kl.Controller(model, own).problem
    np.testing.assert_allclose((kept.du_max, kept.deceleration), ((0.2, 1.0), (0.5, 1.0)))


def test_changes_that_a_log_does_not_hold_are_not_asked_for() -> None:
    """A stick that is moved gently: from rest to 1 m/s in a second, and back in half of one."""
    times = DT * np.arange(1200)
    turn = np.where(np.sin(times) > 0.0, 0.8, -0.8)
    speed = np.interp(times % 4.0, (0.0, 1.0, 2.0, 2.5, 4.0), (0.0, 1.0, 1.0, 0.0, 0.0))
    log = Dataset([Episode(np.zeros((1201, 3)), np.column_stack([speed, turn]), DT)])
    shown = shown_changes(log)
    np.testing.assert_allclose((shown.faster[0], shown.slower[0]), (1.0, 2.0), rtol=1e-6)
    assert np.isinf((shown.faster[1], shown.slower[1])).all()
    info = {"changes": shown.as_dict()}
    check_info(info)
    model = dataclasses.replace(kl.nominal_unicycle(DT), info=info)
    np.testing.assert_allclose(kl.Controller(model).problem.du_max, (1.0, np.inf))


def steady_log(path: Path, dither: float = 0.0) -> Path:
    """It stands for 2 s, then drives at 0.3 m/s; its rows come a few milliseconds late or early."""
    random = np.random.default_rng(0)
    times = np.sort(0.1 * np.arange(400) + random.uniform(-0.004, 0.004, 400))
    speed = np.where(times < 2.0, 0.0, 0.3 + dither * random.normal(size=400))
    way = np.concatenate([[0.0], np.cumsum(speed[:-1] * np.diff(times))])
    poses = np.column_stack([way, 0.0 * way, 0.0 * way]) + 0.002 * random.normal(size=(400, 3))
    rows = np.column_stack([times, poses, speed, 0.001 * random.normal(size=400)])
    np.savetxt(path, rows, "%.6f", ",", header="t,x,y,theta,v,omega", comments="")
    return path


@pytest.mark.parametrize("dither", [0.0, 0.004])
def test_a_log_at_one_steady_speed_limits_nothing(tmp_path: Path, dither: float) -> None:
    file = steady_log(tmp_path / "steady.csv", dither)
    model = learn(load_logs([file], how=ReadOptions(force=True)), [file]).model
    assert not Ramps.of(model.info).limit and not Ramps.of(model.info, "changes").limit
    controller, robot, pose = kl.Controller(model), DifferentialDrive(), np.zeros(3)
    for _ in range(60):
        pose = robot.step(pose, controller.step(pose, (1.0, 0.0, 0.0)).command, DT)
    assert np.hypot(pose[0] - 1.0, pose[1]) < 0.05


@pytest.mark.parametrize("wrong", [{"faster": [1.0, 2.0]}, {"faster": [0.0, 1], "slower": [1, 1]}])
def test_ramps_of_a_damaged_file_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ModelError, match=r"info\.ramps: expected limits"):
        check_info({"ramps": wrong})
