"""How fast wheels are steered is found in a car's log, and so is the wheelbase of a slow servo."""

from dataclasses import replace

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.plants.steered import CarPlant, Chassis, Follower
from kmpc_lite.control.wheels import Car
from kmpc_lite.learn.learning import learn
from kmpc_lite.learn.ramps import find_ramps
from kmpc_lite.learn.steering import find_servo, find_wheelbase
from kmpc_lite.types import Array

BASE, LOCK, DT = 0.4, 0.45, 0.1


def drive(rate: float, lag: float = 0.0, seconds: float = 60.0) -> tuple[Array, Array]:
    """Poses (n, 3), and speeds and angles (n, 2), of a car whose servo turns so fast."""
    random = np.random.default_rng(3)
    held = random.uniform(-1.0, 1.0, (round(seconds), 2)) * (0.8, LOCK)
    commands = np.repeat(held, round(1.0 / DT), axis=0)
    plant = CarPlant(Chassis(BASE, LOCK, Follower(0.0, (np.inf, rate), (0.0, lag))), DT, 0)
    poses = [np.zeros(3)]
    for command in commands[:-1]:
        poses.append(plant.drive(poses[-1], command)[-1])
    return np.array(poses), commands


def log_of(poses: Array, commands: Array) -> kl.Dataset:
    v, angle = commands[:-1].T
    inputs = np.column_stack([v, v * np.tan(angle) / BASE])
    return kl.Dataset([replace(kl.Episode(poses, inputs, DT), steered=True)])


@pytest.mark.parametrize("rate", [0.5, 1.5])
def test_the_rate_of_a_servo_is_found(rate: float) -> None:
    ramps = find_ramps(log_of(*drive(rate)))
    assert ramps.faster[1] == ramps.slower[1] == pytest.approx(rate / BASE, rel=0.15)


@pytest.mark.parametrize("lag", [0.0, 0.2])
def test_a_lag_is_no_rate(lag: float) -> None:
    assert not find_ramps(log_of(*drive(np.inf, lag))).limit


def test_the_controller_steers_no_faster_than_the_log_shows() -> None:
    data = log_of(*drive(0.5))
    model = learn(data, []).model
    problem = kl.NavigationProblem(wheels=Car(0.8, 9.0), u_min=(-0.8, -1.0), u_max=(0.8, 1.0))
    controller = kl.Controller(model, problem)
    assert np.isinf(controller.problem.du_max).all()
    curvatures, pose = [0.0], np.zeros(3)
    for _ in range(20):
        plan = controller.step(pose, (1.5, 1.0, 1.5))
        pose = model.predict(pose, plan.command, np.zeros((model.history, 2)))
        if abs(plan.command[0]) > 1e-3:
            curvatures.append(plan.command[1] / plan.command[0])
    assert np.abs(np.diff(curvatures)).max() <= 0.5 / BASE * DT * 1.15


def test_the_wheelbase_of_a_slow_servo_is_found() -> None:
    poses, commands = drive(0.6)
    time = DT * np.arange(len(poses))
    assert find_wheelbase(time, poses, commands[:, 1]) == pytest.approx(BASE, rel=0.06)
    gain, middle = find_servo(time, poses, 0.5 - 0.3 * commands[:, 1])
    assert gain == pytest.approx(-1.0 / 0.3 / BASE, rel=0.12)
    assert middle == pytest.approx(0.5, abs=0.01)
