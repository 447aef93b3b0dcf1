"""Robots that turn about another point than the tracked one: the model tells which."""

import numpy as np
import pytest
from guided import GuideInUse
from hypothesis import given, settings
from hypothesis import strategies as st

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.control.path.capabilities import capabilities, drivable_speeds
from kmpc_lite.control.path.turning_centre import CENTRE_DISTANCE, seen_from, turning_centre

PROBLEM = kl.NavigationProblem(margin=0.05)
NO_CIRCLES = np.empty((0, 5))
POINT = (0.05, 0.02)
METRES = st.floats(-0.06, 0.06)


def learn(
    point: tuple[float, float], slip: float = 0.0, episodes: int = 20, steps: int = 60
) -> kl.KoopmanModel:
    return kl.fit(
        kmpc_lab.generate_dataset(
            kmpc_lab.DifferentialDrive(slip, 1, 1.0, point), episodes, steps, seed=2
        )
    )


@pytest.fixture(scope="module")
def offset_model() -> kl.KoopmanModel:
    return learn(POINT, 0.1, 200, 200)


@settings(max_examples=15, deadline=None)
@given(ahead=METRES, left=METRES)
def test_the_point_is_read_out_of_a_model(ahead: float, left: float) -> None:
    found = turning_centre(learn((ahead, left), episodes=8), PROBLEM)
    if np.hypot(ahead, left) < CENTRE_DISTANCE - 1e-4:
        assert found is None
    elif np.hypot(ahead, left) > CENTRE_DISTANCE + 1e-4:
        np.testing.assert_allclose(found, (ahead, left), atol=1e-4)


@pytest.mark.parametrize("name", ["nominal", "learned", "learned_edmdc", "lagging"])
def test_a_robot_that_turns_about_its_pose_has_none(
    models: dict[str, kl.KoopmanModel], name: str
) -> None:
    assert turning_centre(models[name], PROBLEM) is None


@pytest.mark.parametrize("seed", range(3))
def test_guidance_drives_the_turning_point_to_where_it_is_at_the_goal(seed: int) -> None:
    random = np.random.default_rng(seed)
    offset, start, end = random.uniform(-0.06, 0.06, 2), *random.uniform(-1.5, 1.5, (2, 3))
    guide, plain = GuideInUse(PROBLEM), GuideInUse(PROBLEM)
    guide.turn_about(offset)
    found = guide.reference(start, end, NO_CIRCLES)
    expected = plain.reference(seen_from(start, offset), seen_from(end, offset), NO_CIRCLES)
    assert found.time_left == pytest.approx(expected.time_left)
    np.testing.assert_allclose(seen_from(found.states, offset), expected.states, atol=1e-9)


def test_a_point_that_is_learned_anew_keeps_the_way() -> None:
    guide, x, goal = GuideInUse(PROBLEM), np.array([-1.0, 0.0, 0.3]), np.array([1.0, 0.2, 1.0])
    guide.turn_about(np.array(POINT))
    first = guide.reference(x, goal, NO_CIRCLES)
    guide.turn_about(np.array(POINT) + (0.00099, 0.0))
    assert not any(guide.reference(x, goal, NO_CIRCLES).refreshed for _ in range(9))
    guide.turn_about(np.array(POINT) + (0.00101, 0.0))
    assert any(guide.reference(x, goal, NO_CIRCLES).refreshed for _ in range(9))
    guide.turn_about(np.array(POINT) + (0.006, -0.002))
    steps = [guide.reference(x, goal, NO_CIRCLES) for _ in range(9)]
    assert any(s.refreshed for s in steps) and not any(s.switched for s in steps)
    assert all(np.abs(s.states - first.states)[:, :2].max() < 0.03 for s in steps)


def test_a_floor_that_changes_does_not_move_it(offset_model: kl.KoopmanModel) -> None:
    controller, plant = (
        kl.Controller(offset_model, kl.NavigationProblem()),
        kmpc_lab.DifferentialDrive(0.0, 1, 0.5, POINT),
    )
    x, commands = np.zeros(3), np.random.default_rng(2).uniform(-0.6, 0.6, (60, 2))
    adaptation = controller.adaptation
    assert adaptation is not None
    for u in commands:
        after = plant.step(x, u, 0.1)
        adaptation.update(x, u, after)
        x = after
    assert adaptation.gains.turn == pytest.approx(0.5, abs=0.1)
    before = turning_centre(offset_model, PROBLEM)
    np.testing.assert_allclose(turning_centre(adaptation.model, PROBLEM), before, atol=2e-3)
    # and its way is kept
    guide = GuideInUse(PROBLEM)
    x, goal = np.array([-1.0, 0.0, 0.3]), np.array([1.0, 0.2, 1.0])
    guide.known = capabilities(offset_model, PROBLEM)
    first = guide.reference(x, goal, NO_CIRCLES)
    guide.drive_at(*drivable_speeds(adaptation.model, PROBLEM))
    second = guide.reference(x, goal, NO_CIRCLES)
    assert first.refreshed and not second.refreshed
