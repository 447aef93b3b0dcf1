"""How a robot stops: never assumed better than its log shows."""

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite.learn.coverage import Stopping, measure_stopping

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
