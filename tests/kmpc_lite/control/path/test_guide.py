"""The reference leads around obstacles within the bounds, and waits if there is no path."""

import numpy as np
import pytest
from guide_scenes import DT, NO_CIRCLES, PROBLEM, circles, pose
from guided import GuideInUse

from kmpc_lab.sim.maps.families import random_map
from kmpc_lite.control.kernels.following import locate
from kmpc_lite.control.path.planner import Path
from kmpc_lite.control.path.timed_path import TimedPath

# -- the reference itself


def test_a_free_way_is_driven_at_the_speed_that_the_bounds_allow() -> None:
    guidance = GuideInUse(PROBLEM).reference(pose(-1.5, 0, 0), pose(1.5, 0, 0), NO_CIRCLES)
    assert guidance.reachable and guidance.refreshed and not guidance.hold
    assert guidance.states.shape == (PROBLEM.horizon + 1, 3)
    assert np.diff(guidance.states[:, 0]) == pytest.approx(0.06)
    assert np.allclose(guidance.states[:, 1:], 0.0)
    assert guidance.time_left == pytest.approx(5.0)
    assert np.allclose(guidance.path[[0, -1]], [[-1.5, 0], [1.5, 0]])


@pytest.mark.parametrize("turns", [-2, -1, 1, 3])
def test_headings_of_the_reference_are_next_to_the_robots(turns: int) -> None:
    shift = pose(0, 0, 2 * np.pi * turns)
    plain = GuideInUse(PROBLEM).reference(pose(-1, 0.2, 3.0), pose(1, 0, -3.0), NO_CIRCLES)
    turned = GuideInUse(PROBLEM).reference(pose(-1, 0.2, 3.0) + shift, pose(1, 0, -3.0), NO_CIRCLES)
    assert np.allclose(turned.states, plain.states + shift)
    goal_turned = GuideInUse(PROBLEM).reference(
        pose(-1, 0.2, 3.0), pose(1, 0, -3.0) + shift, NO_CIRCLES
    )
    assert np.allclose(goal_turned.states, plain.states)


def test_the_reference_never_asks_for_more_than_the_bounds() -> None:
    random, u_max = np.random.default_rng(4), PROBLEM.bounds[1]
    for _ in range(50):
        ends = random.uniform(-1.8, 1.8, (2, 3)) * (1, 1, 1.7)
        states = (
            GuideInUse(PROBLEM)
            .reference(
                ends[0],
                ends[1],
                circles((0, 0, 0.2)) if np.abs(ends[:, :2]).min() > 0.6 else NO_CIRCLES,
            )
            .states
        )
        step = np.abs(np.diff(states, axis=0))
        assert np.hypot(step[:, 0], step[:, 1]).max() <= DT * u_max[0] * (1 + 1e-9)
        assert step[:, 2].max() <= DT * u_max[1] * (1 + 1e-9)


# -- no way


@pytest.mark.parametrize("count", [0, 1, 3, 40])
def test_any_number_of_circles_and_any_pose_gives_finite_states(count: int) -> None:
    random, guide = np.random.default_rng(count), GuideInUse(PROBLEM)
    for _ in range(60):
        scene = np.column_stack(
            [
                random.uniform(-2, 2, (count, 2)),
                random.uniform(0, 0.5, count),
                random.uniform(-0.3, 0.3, (count, 2)),
            ]
        )
        guidance = guide.reference(random.uniform(-3, 3, 3), random.uniform(-3, 3, 3), scene)
        assert (
            guidance.states.shape == (PROBLEM.horizon + 1, 3) and np.isfinite(guidance.states).all()
        )


# -- its paths


def test_a_last_turn_is_not_mistaken_for_the_first_one() -> None:
    # over 1 cm, with a first turn from 2.3 to 1.7 and a last one from 1.7 to 3.4: the heading 2.0
    # is on both
    turn = pose(0.0, 0.01, 2.3), pose(0.0, 0.01, 1.7)
    way = Path(np.array([*turn, pose(0.0, 0.0, 1.7), pose(0.0, 0.0, 3.4)]))
    path = TimedPath(way, np.array([0.6, 0.7]))
    here = pose(0.0, 0.009, 2.0)
    first, _ = locate(path.timed, here, 0.0, 0.0)
    assert first < path.drive_end
    last, _ = locate(path.timed, here, first, path.drive_end)
    np.testing.assert_allclose(path.at(np.array([last]))[0], [0.0, 0.0, 2.0], atol=0.04)


def test_a_robot_that_stands_before_an_obstacle_turns_on_the_spot_on_every_new_path() -> None:
    scene = random_map("trap", 10, 0.05)
    guide, random, turned, refreshed = GuideInUse(scene.problem()), np.random.default_rng(0), [], 0
    # beside its way around the corner, and heading as the way does only behind it
    for _ in range(50):
        x = pose(0.705, 0.862, -0.82) + random.normal(size=3) * (0.005, 0.005, 0.02)
        guidance = guide.reference(x, np.array(scene.goal), scene.circles_at(0.0))
        refreshed += guidance.refreshed
        near = np.hypot(*(guidance.states[:6] - x)[:, :2].T).max() < 0.1
        turned.append(near and guidance.states[5, 2] - guidance.states[0, 2] > 0.3)
    assert refreshed > 1 and any(turned)
