"""Errors that a model did not expect widen the margins at once; those it expected do not."""

from dataclasses import replace

import numpy as np
import pytest
from wary import CIRCLES, PROBLEM, Wary, directions, drive_and_observe, of_noise, plan, slipping

from kmpc_lab import DifferentialDrive
from kmpc_lite import KoopmanModel, nominal_unicycle
from kmpc_lite.control.estimate.expected_errors import UNKNOWN_INFLATION
from kmpc_lite.model.noise_model import NoiseModel


@pytest.fixture(scope="module")
def model() -> KoopmanModel:
    return slipping(0.1)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_floor_that_pushes_to_one_side_is_noticed_among_noisy_poses(way):
    """Pushes of 10 mm to one side among poses that are 5 mm wrong: only their sum is large."""
    noise = NoiseModel(np.array([np.diag([5e-5, 5e-5, 8e-4]), np.zeros((3, 3)), np.zeros((3, 3))]))
    model, random, u = (
        replace(nominal_unicycle(0.1), noise_model=noise),
        np.random.default_rng(0),
        np.array([0.5 * way, 0.0]),
    )
    calm, pushed = Wary(model, PROBLEM), Wary(model, PROBLEM)
    sure, wary = calm.error(0.5, 0.0), 0
    for errors in np.diff(random.normal(size=(1001, 2)) * 0.005, axis=0):
        calm.observe(np.append(errors, 0.0), 0.0, u)
        wary += calm.error(0.5, 0.0) > 5.0 * sure
    assert wary < 60
    for errors in np.diff(random.normal(size=(9, 2)) * 0.005, axis=0):
        pushed.observe(np.append(errors + (0.0, -0.010 * way), 0.0), 0.0, u)
    assert pushed.inflation < UNKNOWN_INFLATION and pushed.error(0.5, 0.0) > 5.0 * sure
    pushed.reset()
    assert pushed.error(0.5, 0.0) == sure


@pytest.mark.parametrize("slip", [0.0, 0.05, 0.2])
def test_what_was_expected_widens_nothing(slip):
    model = slipping(slip)
    found = drive_and_observe(Wary(model, PROBLEM), model, DifferentialDrive(slip, seed=3), 4000)
    assert (found == 1.0).mean() > 0.85
    assert np.quantile(found, 0.99) < 2.5


def test_a_floor_that_slips_more_widens_the_margins_at_once():
    model = slipping(0.02)
    wary = of_noise(model)
    lin, states, inputs = plan(model)
    calm = wary.margins(lin, states, inputs, directions(20, 3))
    found = drive_and_observe(wary, model, DifferentialDrive(0.2, seed=3), 200)
    assert found[5] > 2.5
    # mean and scatter of the slip are ten times the learned ones
    assert 6.0 < np.median(found[20:]) < 16.0
    assert (wary.margins(lin, states, inputs, directions(20, 3)) > 2.0 * calm).all()
    x, u = np.array([0.58, 0.0, 0.0]), np.array([0.6, 0.0])
    alarmed = wary.speed_share(x, u, CIRCLES)
    found = drive_and_observe(wary, model, DifferentialDrive(0.02, seed=4), 100)
    assert found[60:].max() < 3.0
    wary.reset()
    assert wary.inflation == 1.0
    assert wary.speed_share(x, u, CIRCLES) > alarmed


def test_standing_and_broken_poses_widen_nothing(model):
    wary = Wary(model, PROBLEM)
    wary.observe(np.array([0.1, 0.1, 0.0]), 0.0, np.zeros(2))
    wary.observe(np.array([np.nan, 0.1, 0.0]), 0.0, np.array([0.5, 0.0]))
    wary.observe(np.array([np.inf, 0.1, 0.0]), 0.0, np.array([0.5, 0.0]))
    wary.observe(np.array([0.1, 0.1, 0.0]), 0.0, np.array([np.nan, 0.0]))
    assert wary.inflation == 1.0
    wary.observe(np.array([1e6, 0.1, 0.0]), 0.0, np.array([0.5, 0.0]))
    assert wary.inflation < 10.0


def test_what_was_felt_is_forgotten_while_the_robot_stands():
    """Margins that let it stand would never shrink else: a robot that stands learns nothing."""
    model = slipping(0.02)
    wary, sharp = Wary(model, PROBLEM), np.array([0.05, 0.0, 0.0])
    for _ in range(3):
        wary.observe(sharp, 0.0, np.array([0.5, 0.0]))
    felt = wary.inflation
    for _ in range(10):
        wary.observe(sharp, 0.0, np.zeros(2))
    assert felt > 3.0 and 0.5 * felt < wary.inflation < felt
    for _ in range(800):
        wary.observe(sharp, 0.0, np.zeros(2))
    assert wary.inflation == 1.0
