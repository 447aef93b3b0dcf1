"""What a log shows of a robot's ways of driving, and what is said of what it lacks."""

from __future__ import annotations

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite.learn.coverage import Stopping, find_coverage, measure_stopping

DT = 0.1
LIMITS = (0.5, 0.5, 1.0)


def held(*commands: tuple[float, float, float]) -> np.ndarray:
    """Commands v, omega, each held for so long [s]."""
    return np.vstack([np.tile([v, omega], (round(s / DT), 1)) for v, omega, s in commands])


def quadrants(v: float = 0.5, omega: float = 1.0, back: bool = True) -> list[np.ndarray]:
    """All that a complete log needs, at these largest speeds."""
    ways = (1.0, -1.0) if back else (1.0,)
    turns = [(s * 0.5 * v, t * 0.5 * omega, 8.0) for s in ways for t in (1.0, -1.0)]
    dashes = [(s * v, 0.0, 8.0) for s in ways] + [(0.0, 0.0, 1.0)]
    spots = [(0.0, omega, 4.0), (0.0, -omega, 4.0)]
    return [held(*turns, *dashes, *spots, *dashes, *turns)]


@pytest.mark.parametrize("scale", [0.1, 1.0, 8.0])
def test_a_log_that_shows_every_way_of_driving_is_complete_whatever_the_robots_speed(scale: float):
    limits = 0.5 * scale, 0.5 * scale, 1.0
    coverage = find_coverage(quadrants(v=0.5 * scale), DT, limits)
    assert coverage.is_complete and coverage.missing == () and coverage.warnings() == []
    assert set(coverage.as_dict().values()) == {1.0}


def test_each_lack_is_named_once_with_what_mends_it() -> None:
    (whole,) = quadrants()
    stretch = [whole[whole[:, 1] >= 0.0]] * 2
    coverage = find_coverage(stretch, DT, LIMITS)
    assert {p.name for p in coverage.missing} == {"right"}
    assert any("turn right" in line for line in coverage.advice())
    assert any("never turns right" in line for line in coverage.warnings())


def test_a_robot_that_must_not_reverse_need_not_show_it() -> None:
    drive = quadrants(back=False) * 2
    assert find_coverage(drive, DT, (0.5, 0.0, 1.0)).is_complete
    assert "reverse" in {p.name for p in find_coverage(drive, DT, LIMITS).missing}


def test_a_log_that_only_drives_wide_turns_says_how_wide() -> None:
    drive = [held((0.5, 1.0, 20.0), (-0.5, -1.0, 20.0), (0.2, 0.4, 20.0), (0.0, 0.0, 1.0))] * 2
    told = [line for line in find_coverage(drive, DT, LIMITS).warnings() if "on the spot" in line]
    assert len(told) == 1 and "nor tighter than on 0.5 m" in told[0] and "a car" in told[0]


DT = 0.1


def log(
    ramp: float = 0.5,
    lag: float = 0.2,
    dead_time: float = 0.1,
    weak: float = np.inf,
    noise: float = 0.0,
    v: float = 0.5,
    stops: int = 6,
) -> kl.Dataset:
    """Drives that end in stops: the command falls by `ramp`, the robot brakes by `weak` at most."""
    random = np.random.default_rng(3)
    episodes = []
    for k in range(stops):
        fall = np.maximum(v - ramp * DT * np.arange(1, 400), 0.0)
        speeds = np.concatenate([np.full(25, v), fall[fall > 0.0], np.zeros(15)])
        inputs = np.column_stack([speeds * (-1.0) ** k, 0.0 * speeds])
        states, speed, robot = [np.zeros(3)], 0.0, LaggingDrive(lag, dead_time)
        for command in inputs:
            after = robot.step(states[-1], command, DT)
            way = np.linalg.norm(after - states[-1])
            slowest = max(0.0, speed - weak * DT)
            way = max(way, 0.5 * (speed + slowest) * DT) if weak < np.inf else way
            speed = slowest if way > speed * DT - 1e-12 and weak < np.inf else way / DT
            speed = max(speed, way / DT) if weak == np.inf else max(speed, min(way / DT, v))
            states.append(states[-1] + [np.sign(command[0] or inputs[0, 0]) * way, 0.0, 0.0])
        poses = np.array(states) + noise * random.normal(size=(len(states), 3)) * [1, 1, 0.5]
        episodes.append(kl.Episode(poses, inputs, DT))
    return kl.Dataset(episodes)


@pytest.fixture(scope="module")
def model() -> kl.KoopmanModel:
    """What a fit would learn of the robot whose brakes are not weak."""
    data = drive_log(LaggingDrive(0.2, 0.1), 10, 60, DT, 1, hold=4)
    return kl.fit(data, kl.HermiteTrigDictionary(0), lags=range(9))


@pytest.mark.parametrize("noise", [0.0, 0.01])
@pytest.mark.parametrize("ramp", [0.5, 1.0])
def test_a_robot_that_follows_its_commands_has_their_deceleration(
    model: kl.KoopmanModel, ramp: float, noise: float
) -> None:
    found = measure_stopping(model, log(ramp, noise=noise))
    assert found.stops == 6 and found.deceleration is not None
    assert 0.7 * ramp < found.deceleration < 1.15 * ramp
    assert found.delay == pytest.approx(0.3, abs=0.11)


def test_a_robot_that_brakes_less_than_commanded_has_its_own_deceleration(model: kl.KoopmanModel):
    found = measure_stopping(model, log(1.0, weak=0.3, noise=0.005))
    assert found.deceleration is not None and found.deceleration < 0.45
    way = 0.5 * found.delay + 0.25 / (2 * found.deceleration)
    assert found.distance(0.5) == pytest.approx(way)


def test_too_few_stops_say_nothing_of_braking(model: kl.KoopmanModel) -> None:
    found = measure_stopping(model, log(stops=1))
    assert found == Stopping(found.delay, 1, None) and found.distance(1.0) is None
