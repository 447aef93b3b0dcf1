"""What must not change a command.

Turns of 2 pi, where the origin lies, which side is called left, what was driven before.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kmpc_lab
import kmpc_lite as kl

DT = 0.1
GOAL = (1.5, 1.5, 0.0)
CIRCLES = (
    (0.6, 0.5, 0.15, 0.0, 0.0),
    (1.35, 0.45, 0.12, 0.0, 0.05),
    (0.4, 1.4, 0.15, -0.05, 0.0),
    (-0.3, 0.8, 0.12, 0.0, 0.0),
)
PLAIN: dict[str, Any] = {"guidance": False, "tightening": None}  # the paper's formulation
VARIANTS: dict[str, dict[str, Any]] = {
    "defaults": {},
    "plain": PLAIN,
    "plain, more passes": {**PLAIN, "sqp_iterations": 25, "tolerance": 1e-6},
}


def commands(
    controller: kl.Controller,
    start: Sequence[float],
    goal: Sequence[float],
    circles: Sequence[Sequence[float]],
    periods: int = 30,
) -> np.ndarray:
    """Commands of a noise-free drive of the exact robot, (periods, 2)."""
    plant, x, sent = kmpc_lab.DifferentialDrive(), np.array(start, dtype=float), []
    for k in range(periods):
        now = np.array(
            [[c[0] + k * DT * c[3], c[1] + k * DT * c[4], *c[2:]] for c in circles]
        ).reshape(-1, 5)
        sent.append(controller.step(x, goal, now).command)
        x = plant.step(x, sent[-1], DT)
    return np.array(sent)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("turns", [-7, 1000])
def test_whole_turns_of_pose_and_goal_change_nothing(
    variant: str, turns: int, nominal: kl.KoopmanModel
) -> None:
    plain = kl.Controller(nominal, **VARIANTS[variant])
    turned = kl.Controller(nominal, **VARIANTS[variant])
    x = np.array([0.0, 0.0, 2.8])
    goal = np.array([-1.0, 1.2, -2.9])
    for _ in range(8):
        one = plain.step(x, goal, CIRCLES)
        other = turned.step(
            x + (0, 0, 2 * np.pi * turns), goal - (0, 0, 2 * np.pi * turns), CIRCLES
        )
        np.testing.assert_allclose(one.command, other.command, atol=1e-6)
        # the plan is given in the pose's own turns
        np.testing.assert_allclose(other.states[0], x + (0, 0, 2 * np.pi * turns), atol=1e-9)
        np.testing.assert_allclose(other.states - (0, 0, 2 * np.pi * turns), one.states, atol=1e-5)
        x = nominal.predict(x, one.command)


def test_the_shorter_turn_is_taken(nominal: kl.KoopmanModel) -> None:
    for heading, goal, sign in (
        (3.0, -3.0, 1.0),
        (-3.0, 3.0, -1.0),
        (0.2, -0.2, -1.0),
        (1.0, 1.0 + 6.0, -1.0),
    ):
        plan = kl.Controller(nominal, kl.NavigationProblem(Q=(1.0, 1.0, 1.0))).step(
            (0.0, 0.0, heading), (0.0, 0.0, goal)
        )
        assert sign * plan.command[1] > 0.05


@pytest.mark.parametrize("variant", VARIANTS)
@settings(max_examples=3, deadline=None)
@given(start=st.tuples(st.floats(-0.3, 0.1), st.floats(-0.3, 0.1), st.floats(-1.4, 1.4)))
def test_a_mirrored_scene_gives_mirrored_commands(variant: str, start: tuple[float, float, float]):
    problem = kl.NavigationProblem(Q=(1.0, 5.0, 0.1))
    nominal = kl.nominal_unicycle(DT)
    goal = (1.5, 1.2, 0.3)
    one = commands(kl.Controller(nominal, problem, **VARIANTS[variant]), start, goal, CIRCLES, 8)
    mirrored = [(c[0], -c[1], c[2], c[3], -c[4]) for c in CIRCLES]
    other = commands(
        kl.Controller(nominal, problem, **VARIANTS[variant]),
        (start[0], -start[1], -start[2]),
        (goal[0], -goal[1], -goal[2]),
        mirrored,
        8,
    )
    np.testing.assert_allclose(one, other * (1, -1), atol=2e-3)


@pytest.mark.parametrize("quarter", [1, 2, 3])
def test_a_turned_scene_with_turned_weights_gives_the_same_commands(
    quarter: int, nominal: kl.KoopmanModel
) -> None:
    angle = quarter * np.pi / 2
    turn = np.round([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def turned(x: float, y: float) -> list[float]:
        return list(turn @ (x, y))

    q = np.diag([1.0, 5.0, 0.1])
    q_turned = q.copy()
    q_turned[:2, :2] = turn @ q[:2, :2] @ turn.T
    options = VARIANTS["plain, more passes"]
    one = commands(
        kl.Controller(nominal, kl.NavigationProblem(Q=q), **options), (0, 0, 0.2), GOAL, CIRCLES, 20
    )
    goal = [*turned(*GOAL[:2]), GOAL[2] + angle]
    circles = [[*turned(*c[:2]), c[2], *turned(*c[3:])] for c in CIRCLES]
    other = commands(
        kl.Controller(nominal, kl.NavigationProblem(Q=q_turned), **options),
        (0, 0, 0.2 + angle),
        goal,
        circles,
        20,
    )
    # at an obstacle 25 passes end a little before the solution
    np.testing.assert_allclose(one, other, atol=5e-3)


def moved_commands(model: kl.KoopmanModel, variant: str, offset: float) -> np.ndarray:
    """The same scene elsewhere."""
    problem = kl.NavigationProblem(
        x_min=(offset - 2, offset - 2, -np.inf), x_max=(offset + 2, offset + 2, np.inf)
    )
    circles = [(c[0] + offset, c[1] + offset, *c[2:]) for c in CIRCLES]
    return commands(
        kl.Controller(model, problem, **VARIANTS[variant]),
        (offset, offset, 0.2),
        (GOAL[0] + offset, GOAL[1] + offset, 0.0),
        circles,
    )


@pytest.mark.parametrize("variant", ["defaults", "plain"])
@pytest.mark.parametrize("offset", [100.0, -1000.0, 5000.0])
def test_where_the_origin_lies_does_not_matter(
    offset: float, variant: str, nominal: kl.KoopmanModel
) -> None:
    # a vehicle's local frame may begin kilometres away
    np.testing.assert_allclose(
        moved_commands(nominal, variant, offset), moved_commands(nominal, variant, 0.0), atol=0.02
    )


@pytest.mark.parametrize("name", ["nominal", "lagging"])
@pytest.mark.parametrize("variant", ["defaults", "plain"])
def test_reset_makes_it_new(name: str, variant: str, models: dict[str, kl.KoopmanModel]) -> None:
    used, fresh = (kl.Controller(models[name], **VARIANTS[variant]) for _ in range(2))
    commands(used, (1.0, -1.0, 2.0), (-1.5, 0.0, 3.0), CIRCLES[:2], 17)
    used.step((np.nan, 0.0, 0.0), GOAL)
    used.reset()
    np.testing.assert_allclose(
        commands(used, (0, 0, 0), GOAL, CIRCLES, 10),
        commands(fresh, (0, 0, 0), GOAL, CIRCLES, 10),
        atol=2e-3,
    )


def test_two_controllers_do_not_know_of_each_other(nominal: kl.KoopmanModel) -> None:
    alone = commands(kl.Controller(nominal), (0, 0, 0), GOAL, CIRCLES, 10)
    one, other = kl.Controller(nominal), kl.Controller(nominal)
    x, y, sent = np.array([0.0, 0.0, 0.0]), np.array([1.0, 1.0, 3.0]), []
    plant = kmpc_lab.DifferentialDrive()
    for k in range(10):
        now = np.array([[c[0] + k * DT * c[3], c[1] + k * DT * c[4], *c[2:]] for c in CIRCLES])
        sent.append(one.step(x, GOAL, now).command)
        y = plant.step(y, other.step(y, (-1.0, -1.0, 0.0)).command, DT)
        x = plant.step(x, sent[-1], DT)
    np.testing.assert_array_equal(np.array(sent), alone)


@pytest.mark.parametrize("name", ["nominal", "learned", "learned_edmdc", "lagging"])
def test_a_plan_begins_where_the_robot_is_and_obeys_its_model(
    name: str, models: dict[str, kl.KoopmanModel]
) -> None:
    controller = kl.Controller(models[name])
    x, past = np.array([0.0, 0.0, 0.4]), np.zeros((models[name].history, 2))
    for _ in range(12):
        plan = controller.step(x, GOAL, CIRCLES)
        np.testing.assert_allclose(plan.states[0], x, atol=1e-12)
        np.testing.assert_array_equal(plan.inputs[0], plan.command)
        rollout = models[name].rollout(x, plan.inputs, past if len(past) else None)
        # one pass leaves a defect that the next one repairs; a few periods ahead it must be small
        assert np.abs(rollout[:4] - plan.states[:4]).max() < 0.02
        if len(past):
            past = np.vstack([past[1:], plan.command])
        x = rollout[1]


def test_it_keeps_the_history_of_its_commands_itself(lagging: kl.KoopmanModel) -> None:
    """Its first planned step is what the model predicts with the commands really sent."""
    controller = kl.Controller(lagging, **VARIANTS["plain, more passes"])
    x, past = np.array([0.0, 0.0, 0.4]), np.zeros((2, 2))
    differs = 0.0
    for k in range(12):
        # the pose is lost for a while: what is sent then is remembered too
        lost = k in (5, 6)
        plan = controller.step((np.nan, 0.0, 0.0) if lost else x, GOAL)
        following = controller.model.predict(x, plan.command, past)
        if not lost:
            np.testing.assert_allclose(plan.states[1], following, atol=1e-4)
            differs = max(
                differs, float(np.abs(following - controller.model.predict(x, plan.command)).max())
            )
        past = np.vstack([past[1:], plan.command])
        x = following
    assert differs > 1e-2  # the history matters to this model
