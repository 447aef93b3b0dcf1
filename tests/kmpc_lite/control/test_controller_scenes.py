"""Scenes that a robot meets: obstacles at odd places, goals out of reach, a pose that is not where
it should be.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from exact_drives import MODEL, PAPER, RADIUS, Drive

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab.peers.paper import AREA
from kmpc_lite.control.options import PoseOptions

IN_AREA = kl.NavigationProblem(**AREA)


def test_drives_to_the_goal_past_an_obstacle() -> None:
    drive = Drive(
        kl.Controller(MODEL, kl.NavigationProblem(margin=0.02)),
        (0, 0, 0),
        (1.5, 1.5, 0),
        [kl.Circle(0.6, 0.7, 0.15)],
    )
    assert drive.distance(1.5, 1.5) < 0.05
    assert drive.clearance > 0.0
    assert drive.plans[-1].status is kl.PlanStatus.SOLVED


@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (0.45, 0.5, 0.3), (0.5, 0.6, -2.0)])
def test_start_inside_an_obstacle_drives_out(start: tuple[float, float, float]) -> None:
    circle = kl.Circle(start[0] + 0.1, start[1], 0.2)
    drive = Drive(kl.Controller(MODEL), start, (1.5, 1.5, 0.0), [circle], periods=30)
    assert drive.clearances[0] < 0.0
    assert all(plan.clearance < 0.0 for plan in drive.plans[:1])  # and says so
    assert min(drive.clearances[-100:]) > -0.002


def test_an_obstacle_exactly_at_the_robot_is_left() -> None:
    drive = Drive(
        kl.Controller(MODEL),
        (0.3, 0.3, 0.2),
        (1.5, 1.5, 0.0),
        [kl.Circle(0.3, 0.3, 0.2)],
        periods=40,
    )
    assert min(drive.clearances[-100:]) > -0.002
    assert drive.distance(0.3, 0.3) > 0.35


def test_without_guidance_a_goal_inside_an_obstacle_ends_beside_it() -> None:
    drive = Drive(
        kl.Controller(MODEL, **PAPER), (0, 0, 0), (1.0, 0.2, 0), [kl.Circle(1.0, 0.2, 0.2)]
    )
    assert drive.clearance > -0.005
    assert drive.distance(1.0, 0.2) < 0.2 + RADIUS + 0.15
    assert abs(drive.plans[-1].command[0]) < 0.05  # and it stands there


def test_guidance_waits_while_the_goal_is_inside_an_obstacle_and_goes_on_when_it_is_free() -> None:
    controller = kl.Controller(MODEL)
    waiting = Drive(controller, (0, 0, 0), (1.0, 0.2, 0), [kl.Circle(1.0, 0.2, 0.2)], periods=20)
    assert not any(plan.reachable for plan in waiting.plans)
    assert np.abs(waiting.path[:, :2]).max() < 0.05
    going = Drive(controller, tuple(waiting.path[-1]), (1.0, 0.2, 0), [kl.Circle(-1.0, 0.2, 0.2)])
    assert going.plans[-1].reachable and going.distance(1.0, 0.2) < 0.02
    assert going.plans[-1].holding


@pytest.mark.parametrize(
    "goal", [(2.6, 0.0, 0.0), (-3.0, 0.5, 0.0), (0.0, 3.5, 1.5708), (2.5, 2.5, 0.8)]
)
def test_goal_outside_the_area_is_approached_inside(goal: tuple[float, float, float]) -> None:
    drive = Drive(kl.Controller(MODEL, IN_AREA), (0, 0, goal[2]), goal, periods=80)
    assert np.abs(drive.path[:, :2]).max() < 2.02
    nearest = np.clip(goal[:2], -2.0, 2.0)
    assert drive.distance(*nearest) < 0.35


@pytest.mark.parametrize("goal", [(4.0, 0.0, 0.0), (-4.0, 4.0, 2.0), (50.0, 30.0, 0.0)])
def test_nothing_pulls_the_robot_out_of_the_area(goal: tuple[float, float, float]) -> None:
    drive = Drive(kl.Controller(MODEL, IN_AREA), (1.9, 0, 0), goal, periods=300)
    assert np.abs(drive.path[:, :2]).max() < 2.01  # what the solver's tolerance leaves


@pytest.mark.xfail(
    strict=True,
    reason="known limit: without guidance a far goal outweighs the penalty on leaving the area",
)
def test_nothing_pulls_the_robot_out_of_the_area_without_guidance() -> None:
    drive = Drive(
        kl.Controller(MODEL, IN_AREA, **PAPER), (1.9, 0, 0), (50.0, 30.0, 0.0), periods=100
    )
    assert np.abs(drive.path[:, :2]).max() < 2.02


def test_a_robot_outside_the_area_comes_back() -> None:
    drive = Drive(kl.Controller(MODEL, IN_AREA), (2.6, 2.3, 0.4), (0.0, 0.0, 0.0), periods=80)
    assert drive.distance(0.0, 0.0) < 0.1
    assert np.abs(drive.path[:, :2]).max() < 2.75


def far_goal(distance: float, **options: Any) -> Drive:
    """Straight ahead behind an obstacle, and far away."""
    problem = kl.NavigationProblem(x_min=(-100.0, -100.0, -np.inf), x_max=(100.0, 100.0, np.inf))
    controller = kl.Controller(MODEL, problem, **options)
    return Drive(
        controller,
        (0.0, 0.05, np.pi / 2),
        (0.0, distance, np.pi / 2),
        [kl.Circle(0.0, 1.0, 0.2)],
        periods=60,
    )


@pytest.mark.parametrize("distance", [10.0, 30.0, 90.0])
def test_a_far_goal_is_no_reason_to_cut_into_an_obstacle(distance: float) -> None:
    drive = far_goal(distance)
    assert drive.clearance > 0.0
    assert drive.end[1] > 2.0


def test_a_far_goal_is_no_reason_to_cut_into_an_obstacle_without_guidance() -> None:
    assert far_goal(30.0, **PAPER).clearance > -0.02


def test_more_obstacles_than_slots() -> None:
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    ring = [kl.Circle(0.5 + 1.2 * np.cos(a), 0.5 + 1.2 * np.sin(a), 0.05) for a in angles]
    goal = (0.9, 0.9, 0.8)
    drive = Drive(
        kl.Controller(MODEL, obstacle_slots=2),
        (0, 0, 0),
        goal,
        [*ring, kl.Circle(0.55, 0.45, 0.05)],
        periods=60,
    )
    assert drive.clearance > -0.01
    assert drive.distance(0.9, 0.9) < 0.1
    # and a number that changes from one period to the next
    controller = kl.Controller(MODEL, obstacle_slots=2)
    for count in (0, 1, 41, 3, 0, 7):
        assert controller.step((0, 0, 0), goal, ring[:count]).status in (
            kl.PlanStatus.SOLVED,
            kl.PlanStatus.FEASIBLE,
        )


def test_slots_beyond_what_there_is_change_nothing() -> None:
    circles = [kl.Circle(0.7, 0.6, 0.15), kl.Circle(0.2, 1.0, 0.1)]
    few = Drive(
        kl.Controller(MODEL, obstacle_slots=6), (0, 0, 0), (1.5, 1.5, 0), circles, periods=25
    )
    many = Drive(
        kl.Controller(MODEL, obstacle_slots=15), (0, 0, 0), (1.5, 1.5, 0), circles, periods=25
    )
    np.testing.assert_allclose(few.path, many.path, atol=1e-2)  # the solver's tolerance, no more


def test_gives_way_to_a_moving_obstacle() -> None:
    # it crosses the straight way to the goal just when the robot would
    crossing = kl.Circle(0.9, -0.9, 0.15, 0.0, 0.5)
    controller = kl.Controller(MODEL, kl.NavigationProblem(margin=0.03))
    drive = Drive(controller, (0, 0, 0), (1.8, 0.0, 0), [crossing])
    assert drive.clearance > 0.0
    assert drive.distance(1.8, 0.0) < 0.1
    # had its motion not been known, they would have met
    still = kl.Controller(MODEL, kl.NavigationProblem(margin=0.03)).step(
        (0, 0, 0), (1.8, 0.0, 0), [kl.Circle(0.9, -0.9, 0.15)]
    )
    moving = kl.Controller(MODEL, kl.NavigationProblem(margin=0.03)).step(
        (0, 0, 0), (1.8, 0.0, 0), [crossing]
    )
    assert np.abs(still.states - moving.states).max() > 0.02


def test_a_pose_that_jumps_and_is_believed_starts_a_new_plan() -> None:
    options = kl.ControllerOptions(pose=PoseOptions(agreement=0.0))
    controller = kl.Controller(MODEL, options=options)
    x = np.array([0.0, 0.0, 0.0])
    for _ in range(5):
        x = MODEL.predict(x, controller.step(x, (1.5, 1.5, 0.0)).command)
    elsewhere = (-1.0, 1.0, 2.0)
    jumped, fresh = (
        controller.step(elsewhere, (1.5, 1.5, 0.0)),
        kl.Controller(MODEL).step(elsewhere, (1.5, 1.5, 0.0)),
    )
    np.testing.assert_allclose(jumped.states[0], elsewhere)
    np.testing.assert_allclose(jumped.command, fresh.command, atol=1e-2)


def test_a_goal_that_jumps_is_followed() -> None:
    controller = kl.Controller(MODEL)
    first = Drive(controller, (0, 0, 0), (1.0, 0.0, 0.0), periods=20)
    second = Drive(controller, first.end, (-1.0, -0.5, 0.0), periods=70)
    assert second.distance(-1.0, -0.5) < 0.1


def test_a_goal_behind_is_reached_in_reverse_if_that_is_allowed() -> None:
    drive = Drive(kl.Controller(MODEL), (0, 0, 0), (-1.0, 0.0, 0.0), periods=50)
    assert drive.distance(-1.0, 0.0) < 0.05
    assert min(plan.command[0] for plan in drive.plans) < -0.3


@pytest.mark.parametrize("slowest", [0.0, -0.05])
def test_a_robot_that_reverses_slowly_drives_forward_at_speed(slowest: float) -> None:
    problem = kl.NavigationProblem(u_min=(slowest, -0.8))
    drive = Drive(kl.Controller(MODEL, problem), (0, 0, 0), (1.5, 0.0, 0.0), periods=45)
    assert max(plan.command[0] for plan in drive.plans) > 0.5
    assert drive.distance(1.5, 0.0) < 0.05


def test_at_the_goal_it_stands() -> None:
    drive = Drive(
        kl.Controller(MODEL),
        (1.5, 1.5, 0.5),
        (1.5, 1.5, 0.5),
        [kl.Circle(0.5, 0.5, 0.15)],
        periods=30,
    )
    assert np.abs(drive.path - drive.path[0]).max() < 1e-3


def test_a_rejected_plan_is_no_reason_to_stand_for_ever() -> None:
    """At the paper's 1 Hz on hardware, with some slip.

    The robot stands 0.4 m from the nearest obstacle.
    """
    circles = [
        kl.Circle(0.75, -0.2, 0.15),
        kl.Circle(0.8, 0.6, 0.15),
        kl.Circle(0.1, 0.9, 0.15),
        kl.Circle(1.5, 0.6, 0.1),
    ]
    arrived = 0
    for seed in range(6):
        plant, x = kmpc_lab.DifferentialDrive(0.02, seed=seed), np.zeros(3)
        problem = kl.NavigationProblem(dt=1.0, margin=0.05)
        controller = kl.Controller(kl.nominal_unicycle(1.0), problem)
        for _ in range(40):
            plan = controller.step(x, (1.5, 1.5, 1.5708), circles)
            if plan.holding:
                arrived += 1
                break
            x = plant.step(x, plan.command, 1.0)
    assert arrived >= 5
