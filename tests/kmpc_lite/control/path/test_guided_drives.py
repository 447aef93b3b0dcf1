"""Drives along the guide's reference: around dead ends, out of the way, and to the goal."""

from __future__ import annotations

import numpy as np
import pytest
from guide_scenes import DT, PROBLEM, at_rest_in, circles, drive, pose, ring
from guided import GuidedController

import kmpc_lab
import kmpc_lite as kl


def test_a_dead_end_is_driven_around(learned: kl.KoopmanModel) -> None:
    arm = np.arange(-0.6, 0.61, 0.2)
    scene = circles(
        *((0.4, y, 0.12) for y in arm),
        *((x, s * 0.6, 0.12) for x in (-0.4, -0.2, 0.0, 0.2) for s in (1, -1)),
    )
    goal = pose(1.2, 0, 0)
    states, gaps = drive(
        GuidedController(learned, PROBLEM), pose(-1.2, 0, 0), goal, scene, 250, slip=0.05
    )
    assert gaps.min() > 0.0 and at_rest_in(states, goal)


def test_a_robot_waits_outside_a_ring_until_it_opens(learned: kl.KoopmanModel) -> None:
    controller, goal = GuidedController(learned, PROBLEM), pose(0, 0, 1)
    states, gaps = drive(controller, pose(-1.5, -1.5, 0), goal, ring(0.7), 300, slip=0.05, opens=50)
    assert not any(controller.reachable[:50]) and all(controller.reachable[51:])
    assert np.abs(states[:50] - states[0]).max() < 0.02
    assert gaps.min() > 0.0 and at_rest_in(states, goal)


@pytest.mark.parametrize("x", [0.46, 0.40])
def test_a_start_inside_the_inflated_obstacle_is_left_outwards(
    learned: kl.KoopmanModel, x: float
) -> None:
    goal = pose(-1, 0, 0)
    states, gaps = drive(
        GuidedController(learned, PROBLEM),
        pose(x, 0.02, np.pi / 2),
        goal,
        circles((0, 0, 0.3)),
        200,
    )
    # never deeper than at the start but by what the first turn needs, and never in again
    out = int(np.argmax(gaps > 0.0))
    assert gaps.min() >= gaps[0] - 0.01 and out < 230 and (gaps[out:] > 0.0).all()
    assert at_rest_in(states, goal)


@pytest.mark.parametrize("velocity", [(0.0, -0.2), (-0.2, 0.0), (-0.15, -0.2)])
def test_a_parked_robot_makes_room_and_comes_back(
    learned: kl.KoopmanModel, velocity: tuple[float, float]
) -> None:
    # it comes over the goal after 8 s
    scene = circles((-8 * velocity[0], -8 * velocity[1], 0.2, *velocity))
    states, gaps = drive(
        GuidedController(learned, PROBLEM), pose(0, -0.5, 0), pose(0, 0, 0), scene, 250
    )
    assert gaps.min() > 0.0 and at_rest_in(states, pose(0, 0, 0))
    assert np.hypot(*states[:, :2].T)[60:120].max() > 0.3


def test_a_crossing_obstacle_is_let_pass(learned: kl.KoopmanModel) -> None:
    goal = pose(1.5, 0, 0)
    for k in range(0, 6, 2):
        scene = circles((0.2 * k - 0.4, 1.0, 0.25, 0.0, -0.3))
        # the first one is in the way for so long that the robot drives beside it
        states, gaps = drive(
            GuidedController(learned, PROBLEM), pose(-1.5, 0, 0), goal, scene, 250, slip=0.05
        )
        assert gaps.min() > 0.1 and at_rest_in(states, goal)


def test_a_large_obstacle_is_driven_around(nominal: kl.KoopmanModel) -> None:
    problem = kl.NavigationProblem(x_min=(-5.0, -5.0, -np.inf), x_max=(5.0, 5.0, np.inf))
    controller, x = kl.Controller(nominal, problem), pose(-2.2, 0.05, 0.0)
    goal, obstacle = pose(2.2, 0.0, 0.0), kl.Circle(0.0, 0.0, 1.2)
    for _ in range(170):
        plan = controller.step(x, goal, [obstacle])
        assert plan.reachable and plan.clearance > -1e-3
        x = kmpc_lab.DifferentialDrive().step(x, plan.command, DT)
    assert np.hypot(*(x - goal)[:2]) < 0.05


@pytest.mark.parametrize("velocity", [(-0.03, 0.0), (0.0, 0.04), (0.02, 0.0), (0.007, 0.007)])
def test_who_creeps_through_the_way_is_driven_around(
    learned: kl.KoopmanModel, velocity: tuple[float, float]
) -> None:
    goal = pose(1.5, 0, 0)
    scene = circles((0.0, 0.0, 0.35, *velocity))
    states, gaps = drive(GuidedController(learned, PROBLEM), pose(-1.2, 0, 0), goal, scene, 200)
    assert gaps.min() > 0.05 and at_rest_in(states, goal)


def test_who_creeps_through_a_passage_is_waited_for(learned: kl.KoopmanModel) -> None:
    goal = pose(1.5, 0, 0)
    posts = [(0.0, s * y, 0.2) for s in (1, -1) for y in np.arange(0.6, 2.1, 0.3)]
    scene = circles((0.0, 0.35, 0.1, 0.0, -0.05), *posts)
    controller = GuidedController(learned, PROBLEM)
    states, gaps = drive(controller, pose(-1.2, 0, 0), goal, scene, 200)
    assert gaps.min() > 0.0 and at_rest_in(states, goal)


@pytest.mark.parametrize("heading", [0.0, np.pi / 2])
@pytest.mark.parametrize("radius", [0.1, 1.0])
def test_a_goal_between_two_circles_with_one_and_a_half_centimetres_to_spare_is_reached(
    nominal: kl.KoopmanModel, radius: float, heading: float
) -> None:
    away = 0.15 + radius + 0.015
    goal, scene = pose(1, 0, heading), circles((1, away, radius), (1, -away, radius))
    controller = GuidedController(nominal, kl.NavigationProblem())
    states, gaps = drive(controller, pose(-1.5, 0.3, 1), goal, scene, 250)
    assert gaps.min() > 0.01 and at_rest_in(states, goal)
