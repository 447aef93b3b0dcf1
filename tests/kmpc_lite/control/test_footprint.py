"""Footprints: what is read, what covers them, and what a problem makes of them."""

from dataclasses import replace

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.knowledge import scaled_problem
from kmpc_lite.errors import ProblemError

CART = Footprint.rectangle(0.8, 0.3)


def outlines(count: int) -> list[Footprint]:
    """Random convex outlines about poses that may lie anywhere on them."""
    random, found = np.random.default_rng(4), []
    while len(found) < count:
        angles = np.sort(random.uniform(0.0, 2.0 * np.pi, random.integers(3, 9)))
        long, wide = random.uniform(0.1, 1.0, 2)
        corners = np.stack([long * np.cos(angles), wide * np.sin(angles)], axis=1)
        try:
            found.append(Footprint(corners + random.uniform(-0.2, 0.2, 2)))
        except ProblemError:
            continue
    return found


@pytest.mark.parametrize("made", [CART, *outlines(40)])
def test_circles_cover_all_of_it(made: Footprint) -> None:
    shares = np.random.default_rng(1).dirichlet(np.full(len(made.corners), 0.3), 500)
    points = np.concatenate([shares @ made.outline, made.outline])
    away = np.hypot(*(points[:, None] - made.circles).transpose(2, 0, 1)).min(axis=1)
    assert away.max() <= made.circle_radius * (1.0 + 1e-9)
    assert np.hypot(*points.T).max() <= made.radius * (1.0 + 1e-9)


def test_pose_may_lie_off_the_middle() -> None:
    rear = Footprint.rectangle(0.8, 0.3, ahead=-0.2)
    assert rear.radius == pytest.approx(np.hypot(0.6, 0.15))
    assert rear.inner_radius == pytest.approx(0.15)
    assert rear.half_width == pytest.approx(CART.half_width)
    assert np.allclose(rear.circles, CART.circles + (0.2, 0.0))
    beside = Footprint(CART.outline + (0.0, 0.1))
    assert beside.half_width == pytest.approx(0.1 + beside.circle_radius)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ([[0, 0], [1, 0]], "footprint: expected at least 3 corners"),
        ([[0, 0], [1, 0], [0, float("nan")]], "footprint: expected finite corners"),
        ({"length": 0.8, "width": 0.3, "heigth": 1}, "footprint: expected corners"),
        ({"length": 0.8, "width": 0.3, "ahead": "x"}, "footprint: ahead: expected a number"),
        (3, "footprint"),
    ],
)
def test_wrong_footprints_are_reported(value: object, expected: str) -> None:
    with pytest.raises(ProblemError, match=expected):
        Footprint.of(value)


def test_file_may_hold_corners_or_a_table() -> None:
    table = {"length": 0.8, "width": 0.3, "ahead": 0.1}
    assert Footprint.of(table) == Footprint.rectangle(0.8, 0.3, 0.1)
    assert Footprint.of([list(c) for c in CART.corners]) == CART


def test_problem_takes_its_radius_from_the_footprint() -> None:
    problem = kl.NavigationProblem(footprint=CART)
    assert problem.robot_radius == CART.radius
    assert replace(problem, margin=0.1).robot_radius == CART.radius
    assert problem.scale.length == pytest.approx(CART.circle_radius / 0.15)
    units = scaled_problem(problem, problem.scale)
    assert units.footprint is not None
    assert units.footprint.circle_radius == pytest.approx(0.15)
    assert units.robot_radius * problem.scale.length == pytest.approx(CART.radius)
    with pytest.raises(ProblemError, match="robot_radius: follows from the footprint"):
        kl.NavigationProblem(footprint=CART, robot_radius=0.3)
    with pytest.raises(ProblemError, match="footprint: expected a Footprint, got"):
        kl.NavigationProblem(footprint=[[0, 0], [1, 0], [1, 1]])  # type: ignore[arg-type]
