"""Commands that could end in an obstacle are slowed, and no others."""

from dataclasses import replace

import numpy as np
import pytest
from wary import CIRCLES, PROBLEM, Wary, slipping

from kmpc_lab import DifferentialDrive
from kmpc_lite import NavigationProblem, nominal_unicycle
from kmpc_lite.control.estimate.innovation import UNKNOWN_INFLATION
from kmpc_lite.control.margins import UNKNOWN_FLOOR_SLIP

STRANGE = UNKNOWN_INFLATION, UNKNOWN_FLOOR_SLIP


def test_speed_share_never_lets_the_slip_reach_an_obstacle():
    slip = 0.2
    model = slipping(slip)
    wary, plant = Wary(model, PROBLEM), DifferentialDrive(slip, seed=7)
    random = np.random.default_rng(8)
    touched, slowed = 0, 0
    for _ in range(400):
        x = np.array([1.0 - 0.35 - random.uniform(0.002, 0.1), 0.0, random.uniform(-1.2, 1.2)])
        u = np.array([random.uniform(0.1, 0.6), random.uniform(-0.7, 0.7)])
        share = wary.speed_share(x, u, CIRCLES)
        slowed += share < 1.0
        trace = plant.trace(x, share * u, 0.1, 8)
        touched += bool((np.hypot(trace[:, 0] - 1.0, trace[:, 1]) < 0.35).any())
    assert slowed > 200
    assert touched <= 1


def test_many_steps_with_noisy_poses_do_not_end_in_the_obstacle():
    """Each may use up what is left as measured; only what noise leaves sure keeps that outside."""
    noise, ahead = 0.004, np.array([0.6, 0.0])
    model = slipping(0.1)
    assert model.noise_model is not None
    learned = model.noise_model.coefficients.copy()
    learned[0] += 2.0 * noise**2 * np.diag((1.0, 1.0, 0.0))  # of two poses each
    noisy = replace(model, noise_model=replace(model.noise_model, coefficients=learned))
    random, left = np.random.default_rng(4), {}
    for name, known in (("as measured", model), ("sure", noisy)):
        wary, ends = Wary(known, PROBLEM), []
        for _ in range(16):
            x = 1.0 - 0.35 - 0.05
            for _ in range(50):
                seen = np.array([x + random.normal(0.0, noise), 0.0, 0.0])
                x += 0.1 * wary.speed_share(seen, ahead, CIRCLES) * ahead[0]
            ends.append(1.0 - 0.35 - x)
        left[name] = ends
    assert min(left["as measured"]) < 0.0 < 0.01 < min(left["sure"])


def test_a_robot_that_does_not_know_its_floor_is_wary_of_each_command():
    model = nominal_unicycle(0.1)
    wary = Wary(model, PROBLEM)
    sure = wary.error(0.6, 0.0)
    # pushed by a quarter of its way, three times in a row
    for _ in range(3):
        wary.observe(np.array([0.0, -0.015, 0.0]), 0.0, np.array([0.6, 0.0]))
    assert wary.inflation > STRANGE[0] and sure < 0.01
    assert wary.error(0.6, 0.0) > 5.0 * STRANGE[1] * 0.06
    beside, u = np.array([1.0 - 0.38, 0.0, 0.5 * np.pi]), np.array([0.6, 0.0])
    share = wary.speed_share(beside, u, CIRCLES)
    assert share < 0.5 < Wary(model, PROBLEM).speed_share(beside, u, CIRCLES)
    # a model that knows this floor needs no more than it knows
    truth = slipping(0.2)
    wary.update(truth)
    assert wary.error(0.6, 0.0) == pytest.approx(Wary(truth, PROBLEM).error(0.6, 0.0))


@pytest.mark.parametrize(("dt", "accuracy"), [(0.1, 1e-9), (0.5, 1e-9), (1.0, 1.5e-3)])
def test_speed_share_is_not_deceived_by_a_curve_that_ends_farther_away(dt, accuracy):
    """A millimetre beside an obstacle: only the end of the period is farther."""
    model, problem = nominal_unicycle(dt), NavigationProblem(dt=dt)
    circles = np.array([[0.0, 0.0, 0.2, 0.0, 0.0]])
    wary, random = Wary(model, problem), np.random.default_rng(3)
    for _ in range(400):
        x = np.array([0.351, 0.0, random.uniform(-np.pi, np.pi)])
        u = np.array([random.uniform(-0.6, 0.6), random.uniform(-0.78, 0.78)])
        trace = DifferentialDrive().trace(x, wary.speed_share(x, u, circles) * u, dt, 40)
        assert np.hypot(trace[:, 0], trace[:, 1]).min() >= 0.35 - accuracy


def test_errors_of_a_stop_add_up_by_their_squares_and_what_lasts_as_it_is() -> None:
    wary = Wary(slipping(0.2), PROBLEM)
    check, felt = wary.of, wary.felt
    solver = wary.margin(0.0, 0.0)
    one, four = (check.of_motions(felt, np.full(n, 0.06), np.full(n, 0.03))[-1] for n in (1, 4))
    # its headings lead aside by a hair
    assert one == pytest.approx(wary.margin(0.6, 0.3), rel=1e-3)
    lasting = 0.6**2 * felt.position_errors[2] + 0.3**2 * felt.position_errors[3]
    whole = 0.6**2 * felt.position_errors[0] + 0.3**2 * felt.position_errors[1]
    rare, usual = check.noise.step_quantile, check.noise.quantile
    expected = (4 * rare**2 * (whole - lasting) + 16 * usual**2 * lasting) ** 0.5
    assert usual < rare and four - solver == pytest.approx(expected, rel=1e-2)
    # a robot that has stopped errs no farther
    stopped = check.of_motions(felt, np.array([0.06, 0.0, 0.0]), np.zeros(3))
    assert stopped == pytest.approx(np.full(3, wary.margin(0.6, 0.0)), rel=1e-3)


def test_a_robot_that_brakes_is_calmed_by_what_it_feels_and_not_alarmed():
    """One that lags shows its lag as it brakes: that is no floor."""
    wary, driven = Wary(nominal_unicycle(0.1)), (0.0, np.array((0.5, 0.0)))
    slipped, judge = np.array((0.1, 0.0, 0.0)), wary.of.expected_errors.judge
    judge(wary.drift, slipped, *driven, False)
    alarmed = wary.inflation
    judge(wary.drift, 10.0 * slipped, *driven, True)
    assert 1.0 < wary.inflation == alarmed
    for _ in range(60):
        judge(wary.drift, 0.01 * slipped, *driven, True)
    assert wary.inflation == 1.0
