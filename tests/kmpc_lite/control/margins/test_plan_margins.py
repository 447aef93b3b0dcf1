"""What the margins of plans must be for."""

import numpy as np
import pytest
from wary import PROBLEM, Wary, covariances, directions, of_noise, plan, slipping

from kmpc_lab import DifferentialDrive
from kmpc_lite import NavigationProblem, nominal_unicycle
from kmpc_lite.control.margins import SOLVER_MARGIN
from kmpc_lite.control.options import MarginOptions
from kmpc_lite.model.tube import MEMORY, closed_loop

HEADWAY = MarginOptions().headway * PROBLEM.robot_radius
RESERVE = SOLVER_MARGIN * PROBLEM.robot_radius


def test_every_plan_keeps_headway_whatever_its_model_promises():
    exact, normals = nominal_unicycle(0.1), directions(20, 3)
    fast = NavigationProblem(u_min=(-1.0, -1.0), u_max=(2.0, 1.0))
    for problem, v, share in (
        (PROBLEM, 0.0, 0.0),
        (PROBLEM, 0.15, 0.25),
        (PROBLEM, -0.6, 1.0),
        (fast, 0.5, 0.25),
        (fast, 2.0, 1.0),
    ):
        wary, expected = Wary(exact, problem), share * HEADWAY
        own = of_noise(exact).margins(*plan(exact, v), normals)
        np.testing.assert_allclose(wary.margins(*plan(exact, v), normals), own + expected)


def test_an_arc_between_samples_stays_outside_the_circle():
    model = nominal_unicycle(0.1)
    radius, u = PROBLEM.robot_radius, np.array([0.6, -0.78])
    inputs = np.tile(u, (20, 1))
    states = model.rollout((0.0, 0.0, 0.0), inputs)
    lin = model.linearize(states[:-1], inputs)
    margin = of_noise(model).margins(lin, states, inputs, directions(20, 1))[4, 0] - RESERVE
    fine = model.with_dt(0.001).rollout(states[4], np.tile(u, (100, 1)))
    # a circle on the outer side, as near as the margin lets both samples be
    middle, chord = (states[4, :2] + states[5, :2]) / 2, states[5, :2] - states[4, :2]
    outward = np.array([-chord[1], chord[0]]) / np.hypot(*chord)
    half = np.hypot(*chord) / 2
    centre = middle + outward * np.sqrt((radius + margin) ** 2 - half**2)
    assert np.hypot(*(states[4, :2] - centre)) == pytest.approx(radius + margin)
    nearest = np.hypot(*(fine[:, :2] - centre).T).min()
    assert radius - 1e-5 <= nearest <= radius + 1e-3


@pytest.mark.parametrize(
    ("slip", "v", "omega"), [(0.05, 0.6, 0.0), (0.1, 0.6, 0.4), (0.2, 0.3, -0.2), (0.2, 0.6, 0.3)]
)
def test_deviations_under_feedback_stay_within_the_margins(slip, v, omega):
    """Drive the slipping plant many times with the assumed feedback; count drives outside."""
    model, risk, trials = slipping(slip), 0.05, 4000
    lin, states, inputs = plan(model, v, omega)
    wary = Wary(model, PROBLEM, risk=risk, headway=0.0)
    spreads = covariances(wary.felt, lin, states, inputs)
    closed = closed_loop(lin.A, *(f(states[:-1, 2]) for f in (np.cos, np.sin))) - lin.A
    gains = np.linalg.pinv(lin.B) @ closed
    plant = DifferentialDrive(slip, seed=99)
    x = np.tile(states[0], (trials, 1))
    normals = directions(20, 6, seed=5)
    margins = wary.margins(lin, states, inputs, normals) - RESERVE
    worst, outside = np.zeros(trials), np.zeros((20, 6))
    for k in range(20):
        u = inputs[k] + (x - states[k]) @ gains[k].T
        x = plant.step(x, u, 0.1)
        error = (x - states[k + 1])[:, :2]
        outside[k] = (error @ normals[k].T > margins[k]).mean(axis=0)
        if k < MEMORY:
            score = np.einsum("ni,ni->n", error, np.linalg.solve(spreads[k], error.T).T)
            worst = np.maximum(worst, np.sqrt(score))
    assert outside.max() <= risk
    assert (worst > wary.quantile).mean() <= risk + 3 * np.sqrt(risk / trials)
