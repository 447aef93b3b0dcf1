"""The reference leads around obstacles, waits where there is no way, and does not flicker."""

from __future__ import annotations

import numpy as np
import pytest
from guided import GuidedController, GuideInUse

import kmpc_lite as kl
from kmpc_lite.control.guidance.moving_obstacles import MovingObstacles, MovingObstacleTable
from kmpc_lite.control.guidance.state import GuideState
from kmpc_lite.control.guidance.tangent_graph import GeometricPath
from kmpc_lite.control.guidance.timed_path import TimedPath
from kmpc_lite.control.obstacles.circles import circles_to_array
from kmpc_lite.control.options import GuidanceOptions, MovingObstacleOptions, in_metres
from kmpc_lite.sim.maps.families import random_map

DT = 0.1
PROBLEM = kl.NavigationProblem(margin=0.05)
KEEP = PROBLEM.robot_radius + PROBLEM.margin
OPTIONS = in_metres(GuidanceOptions(), PROBLEM.robot_radius)
NO_CIRCLES = np.empty((0, 5))


def pose(*values: float) -> np.ndarray:
    return np.array(values, dtype=float)


def circles(*rows: tuple[float, ...]) -> np.ndarray:
    return circles_to_array([kl.Circle(*row) for row in rows])


def ring(radius: float, count: int = 16, size: float = 0.2) -> np.ndarray:
    angle = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    return np.column_stack(
        [radius * np.cos(angle), radius * np.sin(angle), np.full(count, size), np.zeros((count, 2))]
    )


def drive(
    controller: GuidedController,
    start: np.ndarray,
    goal: np.ndarray,
    scene: np.ndarray,
    periods: int,
    slip: float = 0.0,
    opens: int = 10**9,
) -> tuple[np.ndarray, np.ndarray]:
    """States (T + 1, 3), and gaps between robot and obstacles at ten moments a period (10 T,)."""
    plant, x, states, gaps = kl.DifferentialDrive(slip, seed=1), start, [start], []
    for k in range(periods):
        now = scene if k < opens else scene[3:]
        seen = now.copy()
        seen[:, :2] += k * DT * now[:, 3:]
        plan = controller.step(x, goal, seen)
        trace = plant.trace(x, plan.command, DT, 10)
        for i, p in enumerate(trace, start=1):
            where = seen[:, :2] + i * DT / 10 * seen[:, 3:]
            gaps.append(
                (np.hypot(*(where - p[:2]).T) - seen[:, 2]).min(initial=np.inf)
                - PROBLEM.robot_radius
            )
        x = trace[-1]
        states.append(x)
    return np.array(states), np.array(gaps)


def at_rest_in(states: np.ndarray, goal: np.ndarray) -> bool:
    turn = (states[-1, 2] - goal[2] + np.pi) % (2 * np.pi) - np.pi
    return bool(np.hypot(*(states[-1] - goal)[:2]) <= 0.02 and abs(turn) <= 0.05)


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


def test_the_reference_keeps_clear_of_the_inflated_circle() -> None:
    scene = circles((0, 0.02, 0.3))
    guide, x = GuideInUse(PROBLEM), pose(-1.2, 0, 0)
    for _ in range(80):
        states = guide.reference(x, pose(1.2, 0, 0), scene).states
        assert (np.hypot(states[:, 0], states[:, 1] - 0.02) - 0.3 >= KEEP - 0.003).all()
        # a robot that is always where it was told to be
        x = states[1].copy()
    assert np.hypot(*(x - pose(1.2, 0, 0))[:2]) < 0.02


def test_the_path_ends_in_the_goals_pose_and_the_robot_holds_there() -> None:
    guide, x, goal = GuideInUse(PROBLEM), pose(-0.7, 0.3, 2.0), pose(0.5, 0.4, -1.0)
    for _ in range(150):
        guidance = guide.reference(x, goal, NO_CIRCLES)
        x = guidance.states[1].copy()
    assert guidance.hold and np.hypot(*(x - goal)[:2]) < 0.015
    assert abs((x[2] - goal[2] + np.pi) % (2 * np.pi) - np.pi) < 0.03


# -- when a way is looked for


def test_a_way_is_kept_while_nothing_changes() -> None:
    guide, x, scene = GuideInUse(PROBLEM), pose(-1.5, -0.1, 0), circles((0, 0, 0.3), (0.5, 1, 0.2))
    refreshed = []
    for _ in range(60):
        guidance = guide.reference(x, pose(1.5, 0, 0), scene)
        refreshed.append(guidance.refreshed)
        x = guidance.states[1].copy()
    assert refreshed[0] and sum(refreshed) <= 3


def test_a_new_goal_or_map_is_answered_at_once() -> None:
    guide, x = GuideInUse(PROBLEM), pose(-1.5, 0, 0)
    guide.reference(x, pose(1.5, 0, 0), NO_CIRCLES)
    assert not guide.reference(x, pose(1.5, 0, 0), NO_CIRCLES).refreshed
    assert guide.reference(x, pose(1.5, 0.5, 0), NO_CIRCLES).refreshed
    appeared = guide.reference(x, pose(1.5, 0.5, 0), circles((0, 0.2, 0.3)))
    assert appeared.refreshed
    assert (np.hypot(appeared.path[:, 0], appeared.path[:, 1] - 0.2) >= 0.3 + KEEP - 1e-6).all()
    moved = guide.reference(x, pose(1.5, 0.5, 0), circles((0, 0.3, 0.3)))
    assert moved.refreshed
    grown = guide.reference(x, pose(1.5, 0.5, 0), circles((0, 0.3, 0.4)))
    assert grown.refreshed


def test_a_circle_that_moves_as_foreseen_is_no_reason() -> None:
    guide, x, refreshed = GuideInUse(PROBLEM), pose(-1.5, 0, 0), []
    for k in range(10):
        # far from the way
        guidance = guide.reference(
            x, pose(1.5, 0, 0), circles((-1.0 + 0.02 * k, 1.7, 0.1, 0.2, 0.0))
        )
        refreshed.append(guidance.refreshed)
        x = guidance.states[1].copy()
    assert refreshed == [True] + [False] * 9


def test_the_side_does_not_flicker_when_both_are_as_good() -> None:
    random, guide, sides = np.random.default_rng(1), GuideInUse(PROBLEM), []
    for _ in range(45):
        # the circle shakes by more than is overlooked, so that a way is looked for every time
        scene = circles((0.0, 0.03 * random.normal(), 0.3))
        guidance = guide.reference(pose(-1.5, 0.01 * random.normal(), 0), pose(1.5, 0, 0), scene)
        sides.append(np.sign(guidance.path[np.abs(guidance.path[:, 0]).argmin(), 1]))
    assert len(set(sides)) == 1


def test_a_way_that_is_much_quicker_is_taken() -> None:
    guide, x, goal = GuideInUse(PROBLEM), pose(-1.5, 0, 0), pose(1.5, 0, 0)
    wall = [(0.0, 0.2 * i, 0.12) for i in range(-3, 9)]
    first = guide.reference(x, goal, circles(*wall, (0.0, -1.0, 0.4), (0.0, -1.6, 0.4)))
    # the way below was closed; now it is open, and the one above still is as well
    assert first.path[:, 1].max() > 1.0
    opened = guide.reference(x, goal, circles(*wall))
    assert opened.switched and opened.path[:, 1].min() < -0.5
    assert first.time_left - opened.time_left > OPTIONS.switch_time


def test_a_way_that_is_blocked_is_left() -> None:
    guide, x, goal = GuideInUse(PROBLEM), pose(-1.5, 0.1, 0), pose(1.5, 0.1, 0)
    first = guide.reference(x, goal, circles((0, 0, 0.3)))
    assert first.path[:, 1].max() > 0.4
    blocked = guide.reference(
        x, goal, circles((0, 0, 0.3), (0, 0.6, 0.3), (0, 1.2, 0.3), (0, 1.8, 0.3))
    )
    assert blocked.switched and blocked.path[:, 1].min() < -0.4


def test_two_guides_that_see_the_same_say_the_same() -> None:
    scene = circles((0, 0, 0.3), (0.7, 0.6, 0.2))
    used, fresh = GuideInUse(PROBLEM), GuideInUse(PROBLEM)
    used.reference(pose(1, 1, 1), pose(-1, -1, 0), scene)
    used.state = GuideState()
    a, b = (guide.reference(pose(-1.5, 0, 0), pose(1.5, 0, 0), scene) for guide in (used, fresh))
    assert np.array_equal(a.states, b.states)


# -- no way


def test_a_goal_in_a_closed_ring_is_not_reachable_and_the_robot_waits() -> None:
    guidance = GuideInUse(PROBLEM).reference(pose(-1.5, -1.5, 0.3), pose(0, 0, 1), ring(0.7))
    assert not guidance.reachable and not guidance.hold and guidance.time_left == np.inf
    assert np.allclose(guidance.states, pose(-1.5, -1.5, 0.3))


def test_a_goal_inside_an_obstacle_is_not_reachable() -> None:
    guide = GuideInUse(PROBLEM)
    assert not guide.reference(pose(-1.5, 0, 0), pose(0, 0, 0), circles((0.1, 0, 0.3))).reachable
    # within the clearance, but not touching: it can be had
    assert guide.reference(pose(-1.5, 0, 0), pose(0, 0, 0), circles((0.5, 0, 0.3))).reachable


def test_a_narrow_passage_is_taken_where_there_is_no_other() -> None:
    # 10 cm beyond the radii on either side
    spots = np.concatenate([np.arange(0.25 + 0.15, 2.3, 0.25), -np.arange(0.25 + 0.15, 2.3, 0.25)])
    wall = circles(*((0.0, y, 0.15) for y in spots))
    guidance = GuideInUse(PROBLEM).reference(pose(-1, 1, 0), pose(1, 1, 0), wall)
    assert guidance.reachable
    assert abs(guidance.path[np.abs(guidance.path[:, 0]).argmin(), 1]) < 0.05


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


def test_start_at_the_goal_and_on_a_centre() -> None:
    guide = GuideInUse(PROBLEM)
    assert guide.reference(pose(0, 0, 0), pose(0, 0, 0), NO_CIRCLES).hold
    assert np.isfinite(
        guide.reference(pose(1, 1, 0), pose(0, 0, 0), circles((1, 1, 0.3))).states
    ).all()
    guide.state = GuideState()
    turn = guide.reference(pose(0, 0, 0), pose(0, 0, 3.0), NO_CIRCLES)
    assert not turn.hold and np.allclose(turn.states[:, :2], 0.0)
    assert (np.diff(turn.states[:, 2]) > 0).all()


# -- the closed loop


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
    assert gaps.min() >= gaps[0] - 0.01 and out < 150 and (gaps[out:] > 0.0).all()
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


def test_a_last_turn_is_not_mistaken_for_the_first_one() -> None:
    # over 1 cm, with a first turn from 2.3 to 1.7 and a last one from 1.7 to 3.4: the heading 2.0
    # is on both
    way = GeometricPath(np.array([[0.0, 0.01], [0.0, 0.0]]), np.full(2, 1.7), 1.0, False)
    path = TimedPath(way, pose(0.0, 0.01, 2.3), pose(0.0, 0.0, 3.4), np.array([0.6, 0.7]), OPTIONS)
    here = pose(0.0, 0.009, 2.0)
    first, _ = path.locate(here, 0.0)
    assert first < path.drive_end
    last, _ = path.locate(here, first, path.drive_end)
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
    assert refreshed > 3 and any(turned)


def test_a_robot_gets_out_of_the_way_of_what_comes_after_it_for_good() -> None:
    # to stand 30 cm before it, or to back up before it, would be clear for the next seconds
    slow = np.array([[0.0, 1.1, 0.2, 0.0, -0.15]])
    times = np.arange(0.0, 12.01, 0.1)
    table = MovingObstacleTable(in_metres(MovingObstacleOptions(), PROBLEM.robot_radius))
    _, states = MovingObstacles(slow, KEEP, np.array([0.5, 0.7]), table).evasive_arc(
        pose(0.0, 0.0, np.pi / 2), -1, times
    )
    gaps = np.hypot(states[:, 0], states[:, 1] - (1.1 - 0.15 * times)) - 0.2 - KEEP
    assert gaps.min() > 0.1


def test_a_way_tells_how_much_room_it_keeps() -> None:
    guide, goal = GuideInUse(PROBLEM), pose(1.5, 0, 0)
    wall = np.array(
        [
            [0.0, side * y, 0.2, 0.0, 0.0]
            for side in (1, -1)
            for y in np.arange(0.2 + KEEP + 0.04, 2.6, 0.3)
        ]
    )
    for scene, clearance in ((wall, OPTIONS.narrow_clearance), (wall[:3], OPTIONS.wide_clearance)):
        guidance = guide.reference(pose(-1.5, 0, 0), goal, scene)
        assert guidance.reachable and guidance.path_clearance == clearance


def test_a_large_obstacle_is_driven_around(nominal: kl.KoopmanModel) -> None:
    problem = kl.NavigationProblem(x_min=(-5.0, -5.0, -np.inf), x_max=(5.0, 5.0, np.inf))
    controller, x = kl.Controller(nominal, problem), pose(-2.2, 0.05, 0.0)
    goal, obstacle = pose(2.2, 0.0, 0.0), kl.Circle(0.0, 0.0, 1.2)
    for _ in range(170):
        plan = controller.step(x, goal, [obstacle])
        assert plan.reachable and plan.clearance > -1e-3
        x = kl.DifferentialDrive().step(x, plan.command, DT)
    assert np.hypot(*(x - goal)[:2]) < 0.05
