"""What the guidance says of the goal, and what it tries when the robot gets no nearer."""

import numpy as np
import pytest
from guide_scenes import NO_CIRCLES, OPTIONS, PROBLEM, circles
from guided import GuideInUse

from kmpc_lite.control.path.progress import ProgressState
from kmpc_lite.control.path.situation import Guidance
from kmpc_lite.control.plan import GoalProgress

START = np.array([-1.5, 0.05, 0.0])
STALL_STEPS = round(OPTIONS.stall_time / PROBLEM.dt)


def first_answer(goal: tuple[float, float, float], scene: np.ndarray, **more: object) -> Guidance:
    return GuideInUse(PROBLEM).reference(START, np.array(goal), scene, **more)


# -- goals that cannot be reached are reported in the first step

RING = [(1.0 + 0.6 * np.cos(a), 0.6 * np.sin(a), 0.2) for a in np.arange(12) * np.pi / 6]


@pytest.mark.parametrize(
    ("goal", "rows", "words"),
    [
        ((2.03, 0.0, 0.0), [], "outside the area"),
        ((0.0, -3.0, 0.0), [], "outside the area"),
        ((1.0, 0.0, 0.0), [(1.1, 0.0, 0.2)], "would touch"),
        ((1.0, 0.0, 0.0), [(1.37, 0.0, 0.2)], "within the margin"),
        ((1.0, 0.0, 0.0), RING, "no passage"),
    ],
)
def test_a_goal_that_cannot_be_reached_is_reported_at_once(
    goal: tuple[float, float, float], rows: list[tuple[float, ...]], words: str
) -> None:
    guidance = first_answer(goal, circles(*rows))
    assert guidance.progress is GoalProgress.UNREACHABLE and not guidance.reachable
    assert words in guidance.reason and "\n" not in guidance.reason


def test_a_path_that_is_still_looked_for_is_waited_for() -> None:
    ticks = iter(np.arange(100.0))
    guide = GuideInUse(PROBLEM, clock=lambda: float(next(ticks)))
    goal, scene = np.array([1.5, 0.0, 0.0]), circles((0.0, 0.0, 0.3))
    guidance = guide.reference(START, goal, scene, until=0.0)
    assert guidance.progress is GoalProgress.WAITING and "looked for" in guidance.reason
    while not (guidance := guide.reference(START, goal, scene, until=0.0)).refreshed:
        assert guidance.progress is GoalProgress.WAITING
    assert guidance.progress is GoalProgress.DRIVING and guidance.reason == ""


# -- a robot that gets no nearer


def test_a_robot_that_is_held_tries_something_else_in_time_and_then_says_so() -> None:
    guide, goal = GuideInUse(PROBLEM), np.array([1.5, 0.0, 0.0])
    scene = circles((0.0, 0.0, 0.3))
    answers = [guide.reference(START, goal, scene) for _ in range(3 * STALL_STEPS + 20)]
    sides = [np.sign(a.path[np.abs(a.path[:, 0]).argmin(), 1]) for a in answers]
    told = [a.progress is GoalProgress.WAITING for a in answers]
    parts = 12
    assert set(sides[: STALL_STEPS - parts]) == {sides[0]}
    assert -sides[0] in sides[STALL_STEPS : STALL_STEPS + parts]
    # what has led nowhere is not taken again at once
    assert set(sides[STALL_STEPS + parts : 2 * STALL_STEPS]) == {-sides[0]}
    assert not any(told[: 2 * STALL_STEPS]) and all(told[2 * STALL_STEPS + parts :])
    assert "no progress" in answers[-1].reason and answers[-1].reachable
    # then one with less clearance, from whichever side
    clearances = {a.path_clearance for a in answers[2 * STALL_STEPS + 2 * parts : 3 * STALL_STEPS]}
    assert clearances == {OPTIONS.narrow_clearance}
    # it drives on: all is well again
    x = START.copy()
    for _ in range(10):
        guidance = guide.reference(x, goal, scene)
        x = guidance.states[1].copy()
    assert guidance.progress is GoalProgress.DRIVING and guidance.reason == ""
    assert not guide.state.tried


@pytest.mark.parametrize("beside", [0.0138, 0.0147])
def test_a_robot_that_cannot_get_nearer_holds_where_it_would_not_leave_again(
    beside: float,
) -> None:
    guide, goal = GuideInUse(PROBLEM), np.array([1.5, 0.0, 0.0])
    x = goal + (0.0, beside, 0.0)
    held = [guide.reference(x, goal, NO_CIRCLES).hold for _ in range(STALL_STEPS + 5)]
    assert not any(held[: STALL_STEPS - 5]) and held[-1]
    farther = GuideInUse(PROBLEM)
    x = goal + (0.0, 0.03, 0.0)
    held = [farther.reference(x, goal, NO_CIRCLES).hold for _ in range(3 * STALL_STEPS)]
    assert not any(held)
    assert farther.reference(x, goal, NO_CIRCLES).progress is GoalProgress.WAITING


def test_a_stalled_robot_turns_where_it_is() -> None:
    """Forwards alone, 12 mm beside the goal: too far to turn at once, too near for another path."""
    guide, goal = GuideInUse(PROBLEM), np.array([1.5, 0.0, 0.0])
    x = goal + (0.0, 0.012, 0.4)
    turns = [guide.reference(x, goal, NO_CIRCLES).states[-1, 2] for _ in range(STALL_STEPS + 5)]
    assert guide.state.turning and turns[-1] < 0.3


# -- the counting itself


def watched(left: np.ndarray, drives: bool) -> list[int]:
    """Steps at which a robot has stalled whose paths take so long, step by step."""
    state, found = ProgressState(), []
    state.begin_path(float(left[0]), 0.0, True)
    for k, seconds in enumerate(left):
        if k and left[k] > left[k - 1] + 1.0:
            state.begin_path(float(seconds), 0.0, False)
        state.see(float(seconds) if drives else 20.0, PROBLEM.dt)
        if state.watch(float(seconds), PROBLEM.dt, OPTIONS.stall_time):
            found.append(k)
    return found


def test_a_detour_is_driven_to_its_end_but_not_for_ever() -> None:
    detour = np.concatenate([[5.0], np.arange(12.0, 0.0, -0.1)])
    assert watched(detour, drives=True) == []
    # a detour was found: a robot that drives it has more time, one that stands has not
    assert watched(np.append(5.0, np.full(60, 12.0)), drives=False)[0] == pytest.approx(
        STALL_STEPS, abs=2
    )
    to_and_fro = 8.0 + 3.0 * np.abs(np.arange(600) / 30 % 2 - 1)
    stalls = watched(to_and_fro, drives=True)
    assert stalls and stalls[0] <= STALL_STEPS + 2 * 30 + 60
