"""State is data: a controller copies, pickles and is taken back, in the middle of any drive."""

import copy
import pickle

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab.sim.maps import random_map
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array

FAMILIES = ("open", "narrow", "moving", "walls", "rooms")
STEPS, LATER = 60, 16  # of a drive, and how many of them a copy goes on


def commands(
    controller: kl.Controller,
    scenario: Scenario,
    x: Array,
    plant: kmpc_lab.DifferentialDrive,
    first: int,
) -> Array:
    """Plans (T, ...) of the next steps of a drive, which begin with step `first`."""
    found = []
    for k in range(first, first + LATER):
        plan = controller.step(x, scenario.goal, scenario.obstacles_at(0.1 * k))
        found.append(np.concatenate([plan.command, plan.states.ravel(), plan.inputs.ravel()]))
        x = plant.step(x, plan.command, 0.1)
    return np.array(found)


def options(number: int, learned: kl.KoopmanModel, lagging: kl.KoopmanModel) -> kl.Controller:
    """One of four kinds of controller."""
    kinds: list[dict[str, object]] = [{}, {"pose_age": 0.1}, {}, {"guidance": False}]
    problem = kl.NavigationProblem(du_max=(1.0, 4.0)) if number % 4 == 2 else None
    model = lagging if number % 4 == 1 else learned
    return kl.Controller(model, problem, **kinds[number % 4])  # type: ignore[arg-type]


@pytest.mark.parametrize("number", range(6))
def test_a_drive_goes_on_to_the_last_bit_after_a_copy_and_a_pickle(
    number: int, learned: kl.KoopmanModel, lagging: kl.KoopmanModel
) -> None:
    random = np.random.default_rng(number)
    scenario = random_map(FAMILIES[number % len(FAMILIES)], number)
    controller, plant = (
        options(number, learned, lagging),
        kmpc_lab.DifferentialDrive(0.2, seed=number),
    )
    x, until = np.array(scenario.start), int(random.integers(1, STEPS - LATER))
    for k in range(until):
        plan = controller.step(x, scenario.goal, scenario.obstacles_at(0.1 * k))
        x = plant.step(x, plan.command, 0.1)
    copies = [copy.deepcopy(controller), pickle.loads(pickle.dumps(controller))]
    before = copy.deepcopy(controller.state)
    floor = copy.deepcopy(plant)
    expected = commands(controller, scenario, x, copy.deepcopy(floor), until)
    for other in copies:
        np.testing.assert_array_equal(
            commands(other, scenario, x, copy.deepcopy(floor), until), expected
        )
    controller.state = before
    np.testing.assert_array_equal(
        commands(controller, scenario, x, copy.deepcopy(floor), until), expected
    )


def test_a_search_for_a_path_goes_on_after_a_copy_at_every_one_of_its_parts(
    learned: kl.KoopmanModel,
) -> None:
    scenario = random_map("rooms", 3)
    slow = kl.GuidanceOptions(hurried_parts=1)
    controller, x = kl.Controller(learned, guidance=slow), np.array(scenario.start)
    goals = [scenario.goal, (scenario.start[0] + 0.3, scenario.start[1], 0.0)]
    searched = 0
    for k in range(25):
        goal = goals[k // 12 % 2]
        twin = pickle.loads(pickle.dumps(controller))
        guide = controller.state.guide
        searched += guide is not None and guide.search is not None
        plan = controller.step(x, goal, scenario.obstacles_at(0.1 * k))
        same = twin.step(x, goal, scenario.obstacles_at(0.1 * k))
        np.testing.assert_array_equal(plan.inputs, same.inputs)
        x = x + (0.0, 0.02 * (-1) ** k, 0.0) + learned.predict(np.zeros(3), plan.command)
    assert searched > 3


def test_a_plan_pickles_and_knows_its_clearance(learned: kl.KoopmanModel) -> None:
    obstacles = [kl.Circle(0.6, 0.6, 0.15), kl.Wall(1.0, -1.0, 1.0, 0.0, 0.1)]
    plan = kl.Controller(learned).step((0.0, 0.0, 0.0), (1.5, 1.5, 0.0), obstacles)
    other = pickle.loads(pickle.dumps(plan))
    assert other.clearance == plan.clearance < np.inf
    assert other.status is plan.status and other.progress is kl.GoalProgress.DRIVING
