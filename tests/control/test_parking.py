"""Standing still at the goal, and getting there from anywhere nearby with any heading."""

from __future__ import annotations

import numpy as np
import pytest
from guided import GuidedController

import kmpc_lite as kl
from kmpc_lite.control.parking import ENTER, LEAVE, PUSHED, Parking


def test_the_robot_stands_once_inside_and_stays_until_it_is_out() -> None:
    parking = Parking()
    assert not parking.hold(np.array([ENTER[0] + 0.001, 0.0, 0.0]))
    assert not parking.hold(np.array([0.0, 0.0, ENTER[1] + 0.001]))
    assert parking.hold(np.array([ENTER[0] - 0.001, 0.0, 0.0]))
    # between the two thresholds it depends on where it comes from
    between = np.array([0.5 * (ENTER[0] + LEAVE[0]), 0.0, 0.5 * (ENTER[1] + LEAVE[1])])
    assert all(parking.hold(between) for _ in range(100))
    outside = np.array([1.2 * LEAVE[0], 0.0, 0.0])
    assert not all(parking.hold(outside) for _ in range(100))
    assert not parking.hold(between)


def test_a_robot_that_cannot_stop_inside_does_not_hold_yet() -> None:
    parking = Parking()
    assert not parking.hold(np.zeros(3), np.array([ENTER[0] + 0.001, 0.0, 0.0]))
    assert not parking.hold(np.zeros(3), np.array([0.0, 0.0, -ENTER[1] - 0.001]))
    assert parking.hold(np.zeros(3), np.array([ENTER[0] - 0.001, 0.0, 0.0]))


def test_one_pose_far_off_ends_it_at_once() -> None:
    for push in ([PUSHED[0] + 0.01, 0.0, 0.0], [0.0, 0.0, -PUSHED[1] - 0.01]):
        parking = Parking()
        assert parking.hold(np.zeros(3))
        assert not parking.hold(np.array(push))


def test_noise_of_the_pose_does_not_end_it() -> None:
    random, parking = np.random.default_rng(0), Parking()
    parking.hold(np.zeros(3))
    assert all(parking.hold(random.normal(size=3) * (0.005, 0.005, 0.02)) for _ in range(1000))


def test_reset_forgets() -> None:
    parking = Parking()
    parking.hold(np.zeros(3))
    parking.reset()
    assert not parking.hold(np.array([LEAVE[0] - 1e-3, 0.0, 0.0]))


def park(
    model: kl.KoopmanModel, seed: int, slip: float, noise: float = 0.0, periods: int = 250, du_max: tuple[float, float] | None = None
) -> tuple[np.ndarray, np.ndarray, list[bool]]:
    """Poses (T + 1, 3) less the goal's, commands (T, 2), and whether it held: from within 0.6 m, any headings."""
    random = np.random.default_rng(seed)
    bearing, distance = random.uniform(-np.pi, np.pi), 0.6 * np.sqrt(random.uniform())
    x = np.array([distance * np.cos(bearing), distance * np.sin(bearing), random.uniform(-np.pi, np.pi)])
    goal = np.array([0.0, 0.0, random.uniform(-np.pi, np.pi)])
    problem = kl.NavigationProblem() if du_max is None else kl.NavigationProblem(du_max=du_max)
    controller, plant = GuidedController(model, problem), kl.DifferentialDrive(slip, seed)
    states, commands = [x], []
    for _ in range(periods):
        plan = controller.step(x + noise * random.normal(size=3) * (0.005, 0.005, 0.02), goal)
        x = plant.step(x, plan.command, 0.1)
        states.append(x)
        commands.append(plan.command)
    error = np.array(states) - goal
    error[:, 2] = (error[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return error, np.array(commands), controller.holding


@pytest.mark.parametrize("seed", range(12))
def test_any_start_any_heading_ends_at_rest_in_the_pose(learned: kl.KoopmanModel, seed: int) -> None:
    error, commands, holding = park(learned, seed, slip=0.05)
    assert np.hypot(*error[-1, :2]) <= 0.02 and abs(error[-1, 2]) <= 0.05
    # at rest for good: no dithering
    first = holding.index(True)
    assert first < 150 and all(holding[first:]) and not commands[first:].any()


@pytest.mark.parametrize("du_max", [(1.0, 4.0), (0.5, 2.0)])
@pytest.mark.parametrize("seed", range(3))
def test_with_limited_changes_it_parks_too(learned: kl.KoopmanModel, seed: int, du_max: tuple[float, float]) -> None:
    error, commands, holding = park(learned, seed, slip=0.05, du_max=du_max)
    assert np.hypot(*error[-1, :2]) <= 0.02 and abs(error[-1, 2]) <= 0.05
    first = holding.index(True)
    # the command may take some periods to zero, and then stays there
    assert first < 150 and all(holding[first:]) and not commands[first + 5 :].any()


@pytest.mark.long
@pytest.mark.parametrize("slip", [0.0, 0.1, 0.2])
def test_parking_at_every_slip(slip: float) -> None:
    model = kl.fit(kl.generate_dataset(kl.DifferentialDrive(slip, seed=1), episodes=100, steps=100, seed=2))
    for seed in range(40):
        error, commands, holding = park(model, 100 + seed, slip)
        assert np.hypot(*error[-1, :2]) <= 0.02 and abs(error[-1, 2]) <= 0.05
        assert holding[-1] and not commands[holding.index(True) :].any()


@pytest.mark.parametrize("seed", range(4))
def test_a_noisy_pose_ends_there_too(learned: kl.KoopmanModel, seed: int) -> None:
    error, commands, holding = park(learned, 50 + seed, slip=0.05, noise=1.0)
    assert np.hypot(*error[-1, :2]) <= 0.02 and abs(error[-1, 2]) <= 0.06
    assert np.mean(holding[-50:]) > 0.9


def test_a_robot_that_is_pushed_drives_back(learned: kl.KoopmanModel) -> None:
    controller, goal, x = GuidedController(learned, kl.NavigationProblem()), np.zeros(3), np.zeros(3)
    plant = kl.DifferentialDrive()
    assert not controller.step(x, goal).command.any()
    x = np.array([0.1, 0.15, 0.5])
    for _ in range(150):
        x = plant.step(x, controller.step(x, goal).command, 0.1)
    assert np.hypot(*x[:2]) <= 0.02 and abs(x[2]) <= 0.05
