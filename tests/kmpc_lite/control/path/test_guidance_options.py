"""What starts a new search for a path, what a path costs, and how a path ends before its goal."""

from typing import Any

import numpy as np
import pytest
from guided import GuideInUse

import kmpc_lite as kl
from kmpc_lab.peers.paper import AREA
from kmpc_lite.control.kernels.following import times_after
from kmpc_lite.control.path.capabilities import capabilities
from kmpc_lite.control.path.planner import Path, PathRequest, Route
from kmpc_lite.control.path.tangent_graph import GeometricPath
from kmpc_lite.control.path.tangent_planner import TangentPlanner
from kmpc_lite.control.path.timed_path import TimedPath
from kmpc_lite.types import Array

PROBLEM = kl.NavigationProblem(**AREA)
CAPABILITIES = capabilities(kl.nominal_unicycle(0.1), PROBLEM)
START, GOAL = np.array([-1.5, 0.0, 0.0]), np.array([1.5, 0.0, 0.0])
NO_CIRCLES = np.empty((0, 5))
AREA = np.array([-10.0, -10.0, 10.0, 10.0])


def straight(
    length: float, speed: float = 0.5, turn: float = 1.0, deceleration: float = np.inf
) -> TimedPath:
    poses = np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]])
    return TimedPath(Path(poses), np.array([speed, turn]), deceleration=deceleration)


def asked(goal: Array = GOAL, **more: Any) -> PathRequest:
    return PathRequest(
        start=START,
        goal=goal,
        target=goal,
        circles=NO_CIRCLES,
        outline=np.array([[0.0, 0.0, 0.15]]),
        inflation=0.15,
        area=AREA.reshape(2, 2),
        forward=CAPABILITIES.forward,
        backward=CAPABILITIES.backward,
        **more,
    )


def carried(aside: float) -> bool:
    """Whether a robot on its way gets a new path in the step that sees it beside the old one."""
    guide = GuideInUse(PROBLEM)
    for k in range(6):
        guide.reference(START + (0.05 * k, 0.0, 0.0), GOAL, NO_CIRCLES)
    return guide.reference(START + (0.25, aside, 0.0), GOAL, NO_CIRCLES).refreshed


def test_a_robot_carried_by_half_a_metre_gets_another_path_at_once() -> None:
    assert carried(0.505) and not carried(0.495)


def test_a_velocity_given_with_noise_is_no_other_map() -> None:
    guide, circles = GuideInUse(PROBLEM), np.array([[0.0, 0.9, 0.2, 0.0, 0.1]])
    guide.reference(START, GOAL, circles)
    for k in range(1, 6):
        circles = circles + (0.0, 0.01, 0.0, 0.0, 0.0)
        noisy = circles + (0.0, 0.0, 0.0, 0.01 * (-1) ** k, 0.01)
        assert not guide.reference(START, GOAL, noisy).refreshed


def test_a_search_that_is_needed_ends_though_there_is_a_new_reason_in_each_step() -> None:
    guide = GuideInUse(PROBLEM)
    goals = (GOAL + [0.0, 0.01 * i, 0.0] for i in range(100))
    paths = [guide.reference(START, goal, NO_CIRCLES).refreshed for goal in goals]
    assert sum(paths) >= 5


def price_of(path: GeometricPath, clearance: float = 0.06, **more: Any) -> float:
    """What a planner says that a path costs [s]."""
    planner = TangentPlanner(PROBLEM, kl.GuidanceOptions())
    planner.begin(asked(**more))
    planner._landmarks = np.empty((0, 2))
    planner._clearance, planner._widest = clearance, 0.06
    planner._takes(path)
    return planner._price


def test_what_a_path_costs() -> None:
    points = np.array([[-1.5, 0.0], [1.5, 0.0]])
    path = GeometricPath(points, np.zeros(2), 10.0, False)
    like, back = Route(points, False, 0.06, 0.0), Route(points, True, 0.06, 0.0)
    assert price_of(path) == price_of(path, driven=like) == 10.0
    assert price_of(path, 0.03) == pytest.approx(15.0)
    assert price_of(path, driven=back) == pytest.approx(10.0 + 0.5 + 1.0)
    assert price_of(path, driven=back, gear_time=2.0) == pytest.approx(10.0 + 2.0 + 1.0 + 2.0)
    lost = Route(points, False, 0.06, 5.0)
    assert price_of(path, tried=(lost, lost)) == pytest.approx(20.0)
    assert price_of(path, 0.03, tried=(lost,)) == pytest.approx(15.0), "it is another path"
    # a turn that has begun goes on, unless the other one is cheaper by more than was turned
    left = GeometricPath(points, np.full(2, 1.0), 10.0, False)
    rate = float(CAPABILITIES.forward[1])
    assert price_of(left, turned=0.5) == 10.0
    assert price_of(left, turned=-0.5) == pytest.approx(10.0 + 0.5 / rate)


class Turning:
    """A model that turns about a point, with noise and with motions that are no turn."""

    dt, history, inputs, noise_model = 0.1, 0, 2, None
    info: dict[str, Any] = {}

    def __init__(self, ahead: float, deviation: float = 0.0, other: float = 0.0) -> None:
        self._ahead, self._deviation, self._other = ahead, deviation, other
        self.headings = 0

    def predict(self, x: Array, u: Array, history: Any = None) -> Array:
        self.headings = x.shape[1]
        theta, turn = x[..., 2], u[..., 1] * self.dt
        after, drift = theta + turn, self._other * np.sign(turn) * np.cos(3.0 * theta)
        moved = [
            drift - self._ahead * (np.cos(after) - np.cos(theta)),
            -self._ahead * (np.sin(after) - np.sin(theta)),
            turn,
        ]
        return np.asarray(x + np.stack(moved, axis=-1))

    def noise(self, u: Array) -> Array:
        """So much that a log of one step knows the turning centre to the deviation."""
        turned = 0.5 * np.pi / 4 * self.dt
        return np.diag((1.0, 1.0, 0.0)) * (self._deviation * turned) ** 2


def centre(model: Turning) -> bool:
    return capabilities(model, PROBLEM).turning_centre is not None  # type: ignore[arg-type]


# braking


def test_a_robot_that_brakes_slowly_is_led_to_its_goal_as_it_brakes() -> None:
    path, later = straight(2.0, deceleration=0.25), np.arange(0.0, 8.0, 0.01)
    for begin in (0.0, 2.0, 3.6):
        places = path.at(times_after(path.timed, begin, 0.0, later))[:, 0]
        speeds = np.diff(places) / 0.01
        left = 2.0 - places[:-1]
        assert (speeds <= np.minimum(0.5, np.sqrt(2.0 * 0.25 * left)) + 0.01).all()
        assert np.diff(speeds).min() >= -0.25 * 0.01 - 1e-9
        assert places[-1] == pytest.approx(2.0)
    # a second later than at full speed to the end
    places = path.at(times_after(path.timed, 0.0, 0.0, later))[:, 0]
    arrives = later[np.argmax(places >= 2.0 - 1e-9)]
    assert arrives == pytest.approx(4.0 + 1.0, abs=0.02)


def test_a_robot_that_stands_at_once_is_led_at_full_speed_to_the_end() -> None:
    later = np.arange(0.0, 8.0, 0.1)
    np.testing.assert_array_equal(times_after(straight(2.0).timed, 1.5, 0.0, later), 1.5 + later)


def test_after_its_drive_a_robot_that_brakes_turns_as_ever() -> None:
    path = straight(2.0, deceleration=0.25)
    np.testing.assert_array_equal(
        times_after(path.timed, path.drive_end, 0.0, np.ones(1)), [path.drive_end + 1]
    )
    late = times_after(path.timed, 0.0, 0.0, np.array([5.0, 6.0, 7.0]))
    np.testing.assert_allclose(np.diff(late), 1.0)
