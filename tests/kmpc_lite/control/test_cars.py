"""Cars: plans and commands within their curvature, gears, and drives to a pose."""

import ast
from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from tests.helpers.cars import car_problem, drive_car

FOUR = [
    kl.Circle(0.5, 0.3, 0.3),
    kl.Circle(-0.3, 0.6, 0.25),
    kl.Circle(-0.4, -0.6, 0.3),
    kl.Circle(0.7, -0.7, 0.25),
]
MODEL = kl.nominal_unicycle(0.1)


@pytest.mark.parametrize(
    ("start", "goal", "obstacles"),
    [
        ((-1.5, -1.5, 0.0), (1.5, 1.5, 0.0), []),
        ((0.0, 0.0, 0.0), (0.0, 0.3, 0.0), []),
        ((0.0, 0.0, 0.0), (0.0, 0.0, np.pi), []),
        ((-1.5, -1.5, 0.0), (1.5, 1.5, 0.0), FOUR),
        ((-1.5, -1.5, 2.0), (1.5, 1.5, 3.0), FOUR),
    ],
)
def test_a_car_arrives_in_pose_and_is_never_asked_to_turn_where_it_stands(start, goal, obstacles):
    problem = car_problem()
    drive = drive_car(kl.Controller(MODEL, problem), start, goal, obstacles)
    assert drive.held, drive.reason
    assert drive.error[0] < 0.016 and drive.error[1] < 0.06
    speed, turn_rate = drive.commands.T
    assert (np.abs(turn_rate) <= np.abs(speed) / 0.4 + 1e-9).all()
    for circle in obstacles:
        away = np.hypot(*(drive.poses[:, :2] - (circle.x, circle.y)).T)
        assert away.min() > circle.radius + 0.15


def test_a_car_without_reverse_gear_never_backs_up():
    problem = car_problem(wheels=kl.Car(0.4, reverse=False), x_min=(-3, -3, -np.inf))
    drive = drive_car(kl.Controller(MODEL, problem), (0, 0, 0), (-1.0, 0.5, 3.0))
    assert drive.held and drive.commands[:, 0].min() >= 0.0


def test_a_plan_steers_no_faster_than_the_wheels():
    car = kl.Car(0.4, steering_rate=5.0)
    controller = kl.Controller(MODEL, car_problem(wheels=car))
    plan = controller.step((0, 0, 0), (1.0, 1.0, np.pi / 2))
    speed, turn_rate = plan.inputs.T
    reached = 5.0 * 0.1 * np.arange(1, len(speed) + 1)
    assert (np.abs(turn_rate) <= reached * np.abs(speed) + 0.02).all()
    drive = drive_car(controller, (0, 0, 0), (1.0, 1.0, np.pi / 2), plant_rate=5.0)
    assert drive.held, drive.reason


def test_wheels_enter_a_step_in_few_places():
    """As rows of the QP, as admissible commands, and as the planner's motions: nowhere else."""
    room = Path(kl.__file__).parent / "control"
    found = set()
    for path in room.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
        if names & {"Car", "Omni", "Differential"}:
            found.add(path.relative_to(room).as_posix())
    assert found == {
        "wheels.py",
        "problem.py",  # the wheels of a problem that gives none
        "nmpc/qp.py",
        "nmpc/sqp.py",
        "path/motions.py",
        "path/field_planner.py",
    }
