"""What defaults mean for the paper's robot: each is looked at on both sides of its number."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.nmpc.sqp import SQP
from kmpc_lite.control.nmpc.trajectory import at_rest, one_period_later
from kmpc_lite.control.options import GuidanceOptions, lengths_from_radii
from kmpc_lite.control.path.capabilities import clearance_at_speed
from kmpc_lite.control.path.progress import ProgressState
from kmpc_lite.control.path.turning_centre import turning_centre
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.control.units import with_goal_weights

PROBLEM = kl.NavigationProblem()
GUIDANCE = lengths_from_radii(GuidanceOptions(), PROBLEM.robot_radius)


class Robot:
    """A model that does a share of what it is told, and turns about a point."""

    dt, history, inputs, noise_model = 0.1, 0, 2, None
    info: dict[str, Any] = {}

    def __init__(self, share: float = 1.0, ahead: float = 0.0) -> None:
        self._share, self._ahead = share, ahead

    def predict(self, x: np.ndarray, u: np.ndarray, history: Any = None) -> np.ndarray:
        speed, turn = self._share * u[..., 0] * self.dt, self._share * u[..., 1] * self.dt
        theta, after = x[..., 2], x[..., 2] + turn
        moved = [
            speed * np.cos(theta) - self._ahead * (np.cos(after) - np.cos(theta)),
            speed * np.sin(theta) - self._ahead * (np.sin(after) - np.sin(theta)),
            turn,
        ]
        return np.asarray(x + np.stack(moved, axis=-1))

    def noise(self, u: np.ndarray) -> np.ndarray:
        return np.zeros((*u.shape[:-1], 3, 3))


def test_polygons_have_a_hundred_corners_and_cells_a_tenth_of_a_millimetre() -> None:
    def ring(corners: int) -> list[tuple[float, float]]:
        angles = 2 * np.pi * np.arange(corners) / corners
        return [(math.cos(a), math.sin(a)) for a in angles]

    kl.Polygon(ring(100))
    with pytest.raises(kl.ProblemError):
        kl.Polygon(ring(101))
    kl.OccupancyGrid(np.ones((2, 2), dtype=bool), 1.01e-4)
    with pytest.raises(kl.ProblemError):
        kl.OccupancyGrid(np.ones((2, 2), dtype=bool), 0.99e-4)


@pytest.mark.parametrize(("off", "kept"), [(0.499, True), (0.501, False)])
def test_a_plan_is_no_start_for_a_robot_half_a_metre_from_it(off: float, kept: bool) -> None:
    sqp = SQP(PROBLEM, 0)
    plan = at_rest(sqp.qp, np.zeros(3))
    guess = one_period_later(sqp.qp, plan, np.array([0.0, off, 0.0]))
    assert (guess is not None) == kept


@pytest.mark.parametrize(("turned", "kept"), [(0.99, True), (1.01, False)])
def test_nor_for_one_that_is_turned_by_a_radian(turned: float, kept: bool) -> None:
    sqp = SQP(PROBLEM, 0)
    guess = one_period_later(sqp.qp, at_rest(sqp.qp, np.zeros(3)), np.array([0.0, 0.0, turned]))
    assert (guess is not None) == kept


def test_a_ramp_takes_ten_seconds_at_most() -> None:
    slow = kl.NavigationProblem(deceleration=(0.01, 0.01))
    braking = RateLimit(with_goal_weights(slow))
    assert len(braking.ramp(np.array([0.6, 0.0]))) == 100


def test_paths_keep_two_centimetres_beyond_a_margin_and_ten_in_all() -> None:
    class Wide:
        def __init__(self, aside: float) -> None:
            self.aside = aside

        def straight(self, speed: float) -> tuple[float, float]:
            return 0.0, self.aside

    found = [clearance_at_speed(PROBLEM, Wide(a)) for a in (0.03, 0.2)]  # type: ignore[arg-type]
    np.testing.assert_allclose(found, (0.05, 0.1))


@pytest.mark.parametrize(("ahead", "seen"), [(0.0039, False), (0.0041, True)])
def test_a_turning_centre_counts_from_four_millimetres(ahead: float, seen: bool) -> None:
    centre = turning_centre(Robot(ahead=ahead), PROBLEM)  # type: ignore[arg-type]
    assert (centre is not None) == seen


def test_a_robot_that_gets_no_nearer_has_stalled_after_five_seconds() -> None:
    state = ProgressState()
    state.begin_path(10.0, 0.0, other=True)
    stalls = [state.watch(10.0, 0.01, GUIDANCE.stall_time) for _ in range(510)]
    assert sum(stalls) == 1 and np.argmax(stalls) == pytest.approx(500, abs=2)


def test_a_path_that_is_half_a_second_longer_is_a_detour() -> None:
    state = ProgressState()
    state.begin_path(10.0, 0.0, other=True)
    state.see(10.0, 0.3)
    state.begin_path(10.49, 0.0, other=False)
    assert state.waited == 0.3
    state.begin_path(10.51, 0.0, other=False)
    assert state.waited == 0.0
    state.see(10.47, 0.3)
    assert state.waited == 0.3
    assert not state.see(10.45, 0.0) and state.waited == 0.0
    assert not state.see(10.45, 0.79) and state.see(10.45, 0.02)
