from dataclasses import replace

import numpy as np
import pytest

from kmpc_lab import DifferentialDrive
from kmpc_lab.sim.closed_loop import Outcome, drive
from kmpc_lab.sim.plants.lag import Floor, LaggingDrive, drive_log
from kmpc_lite import (
    Controller,
    HermiteTrigDictionary,
    InputHistoryDictionary,
    evaluate,
    fit,
    nominal_unicycle,
)
from kmpc_lite.control.estimate.history import advance_pose
from kmpc_lite.errors import ProblemError
from kmpc_lite.scenario.files import Scenario

DT, LAG, DEAD = 0.1, 0.3, 0.15
NOISE = (0.005, 0.005, 0.02)


def late(longest):
    return InputHistoryDictionary(HermiteTrigDictionary(order=0), lags=tuple(range(1, longest + 1)))


def slow_log(seed, **options):
    return drive_log(LaggingDrive(LAG, DEAD, slip=0.05, seed=seed), seed=seed + 1, **options)


@pytest.fixture(scope="module")
def model():
    return fit(slow_log(1, episodes=30, steps=300), late(8))


def run(plant, commands, dt=DT):
    x, path = np.zeros(3), [np.zeros(3)]
    for u in commands:
        x = plant.step(x, u, dt)
        path.append(x)
    return np.array(path)


def test_without_lag_it_is_the_plain_robot():
    commands = np.random.default_rng(0).uniform(-0.6, 0.6, (50, 2))
    for slip, gain in ((0.0, 1.0), (0.2, 0.6)):
        plain = run(DifferentialDrive(slip, seed=4, turn_gain=gain), commands)
        np.testing.assert_allclose(
            run(LaggingDrive(slip=slip, turn_gain=gain, seed=4), commands), plain, atol=1e-6
        )


def test_first_order_response_after_the_dead_time():
    plant = LaggingDrive(LAG, DEAD)
    path = run(plant, np.tile([0.5, 0.0], (30, 1)))
    moving = np.maximum(np.arange(31) * DT - DEAD, 0.0)
    expected = 0.5 * (moving - LAG * (1.0 - np.exp(-moving / LAG)))
    np.testing.assert_allclose(path[:, 0], expected, atol=1e-9)
    np.testing.assert_allclose(path[:, 1:], 0.0, atol=1e-12)


def test_the_period_of_the_commands_does_not_matter():
    coarse = run(LaggingDrive(LAG, DEAD), np.repeat([[0.5, 0.4], [0.1, -0.6]], 10, axis=0), 0.1)
    fine = run(LaggingDrive(LAG, DEAD), np.repeat([[0.5, 0.4], [0.1, -0.6]], 100, axis=0), 0.01)
    np.testing.assert_allclose(fine[::10], coarse, atol=2e-5)


def test_many_robots_at_once_equal_single_ones():
    commands = np.random.default_rng(5).uniform(-0.6, 0.6, (30, 3, 2))
    together, x = LaggingDrive(LAG, DEAD), np.zeros((3, 3))
    for u in commands:
        x = together.step(x, u, DT)
    for i in range(3):
        np.testing.assert_allclose(
            run(LaggingDrive(LAG, DEAD), commands[:, i])[-1], x[i], atol=1e-12
        )


def test_reset_stands_still_again():
    plant = LaggingDrive(LAG, DEAD)
    first = run(plant, np.tile([0.5, 0.2], (10, 1)))
    plant.reset()
    np.testing.assert_array_equal(run(plant, np.tile([0.5, 0.2], (10, 1))), first)


def test_the_floor_changes_while_driving():
    plant = LaggingDrive(slip=0.0, floors=[Floor(1.0, 0.2), Floor(2.0, 0.0, 0.6)])
    path = run(plant, np.tile([0.5, 0.3], (30, 1)))
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T)
    assert steps[:10] == pytest.approx(np.full(10, steps[0])) and steps[20:].std() < 1e-12
    assert steps[10:20].std() > 1e-3 and steps[10:20].mean() > steps[0]
    assert np.diff(path[:, 2])[20:] == pytest.approx(np.full(10, 0.6 * 0.03))
    plant.reset()
    assert plant.floor.slip == 0.0


def test_pose_noise_of_a_log():
    clean, noisy = (
        slow_log(1, episodes=20, steps=200),
        slow_log(1, episodes=20, steps=200, pose_noise=NOISE),
    )
    error = np.concatenate(
        [a.states - b.states for a, b in zip(noisy.episodes, clean.episodes, strict=True)]
    )
    np.testing.assert_allclose(error.std(axis=0), NOISE, rtol=0.05)


def test_input_history_predicts_a_second_ahead():
    """Held-out figures against the dictionary without history, on the same log."""
    train, held_out = slow_log(1, episodes=30, steps=300), slow_log(11, episodes=20, steps=150)
    plain, short, long = (
        np.array(evaluate(fit(train, d), held_out, 1.0, stride=5).multi_step)
        for d in (None, late(4), late(10))
    )
    assert (short < 0.45 * plain).all()
    assert (long < 0.15 * plain).all()
    assert long[0] < 0.01 and long[2] < 0.015


@pytest.mark.parametrize("age", [0.0, 0.1, 0.2, 0.5])
def test_an_old_pose_is_brought_forward(age):
    plant, commands = LaggingDrive(), np.random.default_rng(6).uniform(-0.6, 0.6, (12, 2))
    path = run(plant, commands)
    back = round(age / DT)
    np.testing.assert_allclose(
        advance_pose(nominal_unicycle(DT), path[12 - back], commands, age), path[12], atol=1e-6
    )


def test_an_old_pose_of_a_lagging_robot(model):
    commands = np.repeat(np.random.default_rng(7).uniform(-0.6, 0.6, (8, 2)), 4, axis=0)
    path = run(LaggingDrive(LAG, DEAD), commands)
    now = advance_pose(model, path[-3], commands, 0.2)
    assert np.abs(now - path[-1]).max() < 0.01 < np.abs(path[-3] - path[-1]).max()
    # fewer commands than the model remembers: the robot stood before
    assert np.isfinite(advance_pose(model, path[0], commands[:1], 0.2)).all()


@pytest.mark.parametrize(
    "options", [{"lag": -0.1}, {"dead_time": np.nan}, {"slip": -1.0}, {"turn_gain": 0.0}]
)
def test_bad_options(options):
    with pytest.raises(ProblemError, match=next(iter(options))):
        LaggingDrive(**options)
    with pytest.raises(ProblemError, match="rising"):
        LaggingDrive(floors=[Floor(2.0, 0.1), Floor(1.0, 0.1)])
    with pytest.raises(ValueError, match="expected states"):
        LaggingDrive().step(np.zeros(2), np.zeros(2), DT)


def test_the_controller_brings_an_old_pose_forward():
    scenario = replace(Scenario.load("four_circles_1"), margin=0.03, slip=0.0, pose_age=0.3)
    aware = drive(Controller(nominal_unicycle(DT), scenario.problem(), pose_age=0.3), scenario)
    assert aware.outcome is Outcome.REACHED
    # the exact robot: every plan begins where the robot is
    np.testing.assert_allclose(aware.plans[4:, 0], aware.states[4:-1], atol=2e-3)
    assert np.abs(aware.plans[10, 0] - aware.states[7]).max() > 0.05
    with pytest.raises(ProblemError, match="pose_age"):
        Controller(nominal_unicycle(DT), pose_age=-0.1)
