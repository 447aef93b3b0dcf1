"""Wheels that saturate together: |v| + track / 2 |omega| <= max_wheel_speed."""

import math

import numpy as np
import pytest

import kmpc_lite as kl

TRACK, FASTEST = 0.4, 0.6
GOAL = (2.0, 0.5, 2.0)
AREA = {"x_min": (-3, -3, -np.inf), "x_max": (3, 3, np.inf)}
BOUNDS = {"u_min": (-0.6, -3.0), "u_max": (0.6, 3.0), **AREA}
WHEELS = {"track": TRACK, "max_wheel_speed": FASTEST}


def outer_wheel(commands):
    """Speed of the faster wheel [m/s]."""
    return np.abs(commands[..., 0]) + 0.5 * TRACK * np.abs(commands[..., 1])


def drive(problem, solver="osqp"):
    """Drive past a circle with a robot that scales its wheels down; seconds and commands."""
    model = kl.nominal_unicycle(0.1)
    controller, pose, asked = kl.Controller(model, problem, solver=solver), (-1.5, -1.0, 1.5), []
    for _ in range(200):
        plan = controller.step(pose, GOAL, [kl.Circle(1.0, 0.1, 0.3)])
        asked.append(plan.inputs)
        possible = min(1.0, FASTEST / max(float(outer_wheel(plan.command)), FASTEST))
        pose = model.predict(pose, possible * plan.command)
        error = np.abs(np.array(pose) - GOAL)
        if error[:2].max() < 0.01 and abs(math.remainder(error[2], math.tau)) < 0.1:
            break
    return 0.1 * len(asked), np.array(asked)


@pytest.mark.parametrize("solver", ["osqp", "clarabel"])
def test_no_plan_asks_a_wheel_for_more_than_it_can(solver):
    _, asked = drive(kl.NavigationProblem(**BOUNDS, **WHEELS), solver)
    assert outer_wheel(asked[:, 0]).max() <= FASTEST * (1.0 + 1e-12)
    assert outer_wheel(asked).max() <= FASTEST * (1.0 + 1e-12)


def test_commands_beyond_the_wheels_keep_their_curve():
    problem = kl.NavigationProblem(**BOUNDS, **WHEELS)
    asked = np.array([(0.5, 1.0), (-0.5, 2.0), (0.1, 0.1), (0.6, 9.0)])
    inside = problem.within_bounds(asked)
    assert outer_wheel(inside).max() <= FASTEST * (1.0 + 1e-12)
    np.testing.assert_allclose(inside[0, 1] / inside[0, 0], 2.0)
    np.testing.assert_array_equal(inside[2], asked[2])


@pytest.mark.parametrize(
    ("fields", "word"),
    [
        ({"track": 0.4}, "max_wheel_speed: missing"),
        ({"max_wheel_speed": 0.6}, "track: missing"),
        ({"track": -1.0, "max_wheel_speed": 1.0}, "track: expected a number >= 0"),
        ({"track": 0.4, "max_wheel_speed": 0.0}, "max_wheel_speed: expected a number > 0"),
        ({"track": 0.4, "max_wheel_speed": np.nan}, "max_wheel_speed: expected a number > 0"),
        ({"track": 0.4, "max_wheel_speed": "1"}, "max_wheel_speed: expected a number > 0"),
    ],
)
def test_half_a_pair_of_wheels_is_refused(fields, word):
    with pytest.raises(kl.ProblemError, match=word):
        kl.NavigationProblem(**fields)
