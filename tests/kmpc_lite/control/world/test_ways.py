"""Robots whose steps are long: the ways between the stages are kept out of circles, too."""

from __future__ import annotations

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.studies import any_robot, robot_drives
from kmpc_lite.control.kernels.clearance import things_of
from kmpc_lite.control.nmpc.trajectory import leads_elsewhere
from kmpc_lite.control.world.half_planes import KeepOut, keep_out
from kmpc_lite.control.world.ways import WayKeepOut
from kmpc_lite.types import Array

PROBLEM = kl.NavigationProblem(horizon=3, dt=1.0)
COLUMNS = 7
"""Three circles and four sides."""
SMALL = things_of(np.array([[0.9, 0.05, 0.05, 0.0, 0.0]]))
LEAP = np.array([[0.0, 0.0, 0.0], [0.6, 0.0, 0.0], [1.2, 0.0, 0.0], [1.8, 0.0, 0.0]])


def tightened(keeper: KeepOut, states: Array, circles: Array, margin: float = 0.0) -> Array:
    found = keeper.clearances(states, circles, None)
    return keeper.tighten(states, circles, found, np.full(found.values.shape, margin))


def test_a_leap_over_a_circle_is_seen() -> None:
    assert KeepOut(PROBLEM, 5).clearances(LEAP, SMALL, None).values[:, 0].min() > 0.0
    keeper = WayKeepOut(PROBLEM, 5)
    found = keeper.clearances(LEAP, SMALL, None)
    # the way from stage 1 to stage 2 leads by its centre at 0.05 m, below it
    np.testing.assert_allclose(found.values[1, 0], 0.05 - 0.05 - 0.15)
    np.testing.assert_allclose(found.normals[1, 0], [0.0, -1.0])
    np.testing.assert_allclose(keeper.penetration(LEAP, SMALL), [0.0, 0.15, 0.0])


def rows(keeper: KeepOut, states: Array, values: Array, normals: Array) -> tuple[Array, Array]:
    """Normals and offsets of the first columns, none left out."""
    normals, offsets = keeper.half_planes(states, values, normals)
    return normals[:, :COLUMNS].copy(), offsets[:, :COLUMNS].copy()


@pytest.mark.parametrize("margin", [0.0, 0.07])
def test_half_planes_are_the_slopes_of_clearances(margin: float) -> None:
    random, keeper = np.random.default_rng(3), WayKeepOut(PROBLEM, 8)
    margins = np.full((3, COLUMNS), margin)
    for _ in range(20):
        states = np.cumsum(random.normal(0.0, 0.4, (4, 3)), axis=0)
        places, sizes = random.normal(0.0, 1.0, (3, 2)), random.uniform(0.05, 0.2, (3, 1))
        circles = things_of(np.hstack([places, sizes, random.normal(0.0, 0.1, (3, 2))]))
        found = keeper.clearances(states, circles, None)
        values = keeper.tighten(states, circles, found, margins).copy()
        normals, offsets = rows(keeper, states, values, found.normals)
        shares = keeper.shares()[:, :COLUMNS, None]

        def beyond(at: Array, n: Array = normals, o: Array = offsets, s: Array = shares) -> Array:
            points = s * at[1:, None, :2] + (1.0 - s) * at[:-1, None, :2]
            out: Array = (n * points).sum(axis=-1) - o
            return out

        np.testing.assert_allclose(beyond(states), values, atol=1e-12)
        moved = states.copy()
        moved[1:] += 1e-6 * random.normal(size=(3, 3))
        now, inside = tightened(keeper, moved, circles, margin), values < 0.0
        np.testing.assert_allclose(now[inside], beyond(moved)[inside], atol=1e-9)
        deepest = np.maximum(-values.min(axis=1), 0.0)
        np.testing.assert_allclose(keeper.penetration(states, circles, None, margins), deepest)


def test_the_first_way_leads_no_nearer_to_what_the_robot_stands_beside() -> None:
    # the robot's edge is 1 mm from a circle that its step would cut
    circle = things_of(np.array([[0.3, 0.2, 0.2, 0.0, 0.0]]))
    away = 0.351 * np.array((-0.8, -0.6))
    here = np.array([*(circle[0, :2] + away), 0.0])
    states = np.array(
        [here, here + (0.6, 0.0, 0.0), here + (1.2, 0.0, 0.0), here + (1.8, 0.0, 0.0)]
    )
    keeper = WayKeepOut(PROBLEM, 5)
    assert tightened(KeepOut(PROBLEM, 5), states, circle)[0, 0] > 0.0
    for margin in (0.001, 0.1):
        # the end lies 0.8 x 0.6 m behind the line across the direction away
        assert tightened(keeper, states, circle, margin)[0, 0] == pytest.approx(-0.48, abs=1e-3)
    # away from it, all is as without ways
    back = states * (-1.0, 1.0, 1.0) + (2.0 * here[0], 0.0, 0.0)
    np.testing.assert_allclose(
        tightened(keeper, back, circle)[0], tightened(KeepOut(PROBLEM, 5), back, circle)[0]
    )


def test_ways_are_looked_at_where_steps_are_long() -> None:
    def looks(dt: float, **settings: object) -> bool:
        problem = kl.NavigationProblem(dt=dt)
        controller = kl.Controller(kl.nominal_unicycle(dt), problem, adaptation=False, **settings)  # type: ignore[arg-type]
        return controller._sqp.ways

    assert looks(1.0) and not looks(0.1) and not looks(0.5)
    assert not looks(0.1, sqp_iterations=10)
    # three radii of 0.15 m are what 0.6 m/s make in 0.75 s
    assert looks(0.8) and not looks(0.7, sqp_iterations=10)
    assert not looks(1.0, guidance=False) and not looks(1.0, tightening=None)
    assert type(keep_out(PROBLEM, 5)) is KeepOut


def test_a_plan_on_the_other_side_is_told() -> None:
    above, below = LEAP + (0.0, 0.3, 0.0), LEAP - (0.0, 0.3, 0.0)
    assert leads_elsewhere(above, below, SMALL)
    assert not leads_elsewhere(above, LEAP + (0.0, 0.2, 0.0), SMALL)
    assert not leads_elsewhere(above, below, SMALL + (0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0))


@pytest.mark.parametrize("seed", [88801, 88837])
def test_a_robot_at_1_hz_gets_past_what_its_step_leaps_over(seed: int) -> None:
    robot = next(robot for robot in any_robot.LIMITS if robot.name == "1 s, N 20")
    row = robot_drives.drive(robot, seed)
    assert row.in_pose and not row.collided
