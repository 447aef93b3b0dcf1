"""Standing still at the goal, and getting there from anywhere nearby with any heading."""

from dataclasses import replace

import numpy as np
import pytest
from guided import GuidedController

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab.peers.ipopt import AREA
from kmpc_lab.sim.plants.lag import LaggingDrive
from kmpc_lite.control.options import GoalOptions
from kmpc_lite.control.path.progress import GoalCheckerState, goal_tolerances, holds
from kmpc_lite.model.noise_model import NoiseModel, NoiseSources
from kmpc_lite.option_fields import lengths_from_radii

OPTIONS = lengths_from_radii(GoalOptions(), 0.15)
QUIET = goal_tolerances(kl.nominal_unicycle(0.1), OPTIONS)
ENTER = QUIET.enter_distance, QUIET.enter_angle
LEAVE = QUIET.leave_distance, QUIET.leave_angle
PUSHED = QUIET.pushed_distance, QUIET.pushed_angle


class Goal:
    """A goal checker with its state."""

    def __init__(self, model: kl.KoopmanModel | None = None) -> None:
        self.state = GoalCheckerState()
        self.tolerances = QUIET if model is None else goal_tolerances(model, OPTIONS)

    def holds(self, error: np.ndarray, rest: np.ndarray | None = None) -> bool:
        return holds(self.state, self.tolerances, error, False, error if rest is None else rest)


def test_the_robot_stands_once_inside_and_stays_until_it_is_out() -> None:
    goal = Goal()
    assert not goal.holds(np.array([ENTER[0] + 0.001, 0.0, 0.0]))
    assert not goal.holds(np.array([0.0, 0.0, ENTER[1] + 0.001]))
    assert goal.holds(np.array([ENTER[0] - 0.001, 0.0, 0.0]))
    # between the two thresholds it depends on where it comes from
    between = np.array([0.5 * (ENTER[0] + LEAVE[0]), 0.0, 0.5 * (ENTER[1] + LEAVE[1])])
    assert all(goal.holds(between) for _ in range(100))
    assert not all(goal.holds(np.array([1.2 * LEAVE[0], 0.0, 0.0])) for _ in range(100))
    assert not goal.holds(between)


def test_a_robot_that_cannot_stop_inside_does_not_hold_yet() -> None:
    goal = Goal()
    assert not goal.holds(np.zeros(3), np.array([ENTER[0] + 0.001, 0.0, 0.0]))
    assert not goal.holds(np.zeros(3), np.array([0.0, 0.0, -ENTER[1] - 0.001]))
    assert goal.holds(np.zeros(3), np.array([ENTER[0] - 0.001, 0.0, 0.0]))


def test_errors_that_soon_grow_no_more_are_no_noise_of_the_pose() -> None:
    still, none = 1e-6 * np.eye(3), np.zeros((2, 3))
    sources = NoiseSources(np.full(3, 1e-3), np.zeros(3), none, none)
    noise = NoiseModel(np.array([still, 0.0 * still, 0.0 * still]), sources)
    model = replace(kl.nominal_unicycle(0.1), noise_model=noise)
    assert Goal(model).tolerances == QUIET


def test_one_pose_far_off_ends_it_at_once() -> None:
    for push in ([PUSHED[0] + 0.01, 0.0, 0.0], [0.0, 0.0, -PUSHED[1] - 0.01]):
        goal = Goal()
        assert goal.holds(np.zeros(3))
        assert not goal.holds(np.array(push))


def test_a_robot_that_lags_holds_sooner_where_it_may_stand_farther_off() -> None:
    """With noisy poses and a model that knows of neither: steps until it has held for a second."""

    def steps(asked: tuple[float, float] | None) -> int:
        problem = kl.NavigationProblem(**AREA, goal_tolerance=asked, du_max=(1.0, 4.0))
        step, _, away = until_held(problem, 0.12, (0.006, 0.006, 0.01), 10, 300)
        assert away < 0.06 or step == 300
        return step

    assert steps((0.05, 0.15)) < steps(None)


def until_held(
    problem: kl.NavigationProblem,
    dead_time: float,
    noise: tuple[float, float, float],
    steps: int,
    most: int,
    because: str = "",
) -> tuple[int, kl.Plan, float]:
    """Drive a robot that lags, by noisy poses and a model that knows of neither.

    The step in which it has held for so many (`most` where it has not) for a reason, the last plan,
    and how far the robot is from its goal then [m].
    """
    controller = kl.Controller(kl.nominal_unicycle(0.1), problem, adaptation=False)
    robot, random = LaggingDrive(lag=0.1, dead_time=dead_time, seed=1), np.random.default_rng(2)
    x, goal, held = np.array([-1.0, 0.4, 0.5]), np.array([1.0, 0.0, 0.0]), 0
    for step in range(most):
        plan = controller.step(x + random.normal(size=3) * noise, goal)
        held = held + 1 if plan.holding and because in plan.reason else 0
        if held == steps:
            return step, plan, float(np.hypot(*(x - goal)[:2]))
        x = robot.step(x, plan.command, 0.1)
    return most, plan, float(np.hypot(*(x - goal)[:2]))


def test_what_cannot_be_reached_more_closely_is_held_and_reported() -> None:
    """A robot whose poses are noisier than its model knows, and that lags, comes to an end."""
    problem = kl.NavigationProblem(**AREA, du_max=(1.0, 4.0))
    noise, because = (0.015, 0.015, 0.03), "does not get nearer"
    # over seeds of the noise 2 to 22 it came to an end after 651 to 1,241 steps
    step, _, away = until_held(problem, 0.15, noise, 20, 1500, because)
    assert step < 1500 and away < 0.06


def park(
    model: kl.KoopmanModel,
    seed: int,
    slip: float,
    noise: float = 0.0,
    periods: int = 250,
    du_max: tuple[float, float] | None = None,
) -> tuple[np.ndarray, np.ndarray, list[bool]]:
    """Park from within 0.6 m: poses (T + 1, 3) less the goal's, commands (T, 2), what held."""
    random = np.random.default_rng(seed)
    bearing, distance = random.uniform(-np.pi, np.pi), 0.6 * np.sqrt(random.uniform())
    x = np.array(
        [distance * np.cos(bearing), distance * np.sin(bearing), random.uniform(-np.pi, np.pi)]
    )
    goal = np.array([0.0, 0.0, random.uniform(-np.pi, np.pi)])
    problem = kl.NavigationProblem() if du_max is None else kl.NavigationProblem(du_max=du_max)
    controller, plant = GuidedController(model, problem), kmpc_lab.DifferentialDrive(slip, seed)
    states, commands = [x], []
    for _ in range(periods):
        plan = controller.step(x + noise * random.normal(size=3) * (0.005, 0.005, 0.02), goal)
        x = plant.step(x, plan.command, 0.1)
        states.append(x)
        commands.append(plan.command)
    error = np.array(states) - goal
    error[:, 2] = (error[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return error, np.array(commands), controller.holding


@pytest.mark.parametrize("seed", range(4))
def test_any_start_any_heading_ends_at_rest_in_the_pose(learned: kl.KoopmanModel, seed: int):
    error, commands, holding = park(learned, seed, slip=0.05)
    assert np.hypot(*error[-1, :2]) <= 0.02 and abs(error[-1, 2]) <= 0.05
    # at rest for good: no dithering
    first = holding.index(True)
    assert first < 150 and all(holding[first:]) and not commands[first:].any()
