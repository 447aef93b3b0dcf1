"""Real skid-steer robots: what a fit on one half of a log says about the other half."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.learn.calibration import prediction_errors
from kmpc_lite.model.noise_model import design, design_across

LOGS = Path(__file__).parents[4] / "shared" / "data" / "norlab_drive"
NEEDED = "needs the Norlab DRIVE logs in ../shared/data/norlab_drive"
pytestmark = pytest.mark.skipif(not LOGS.is_dir(), reason=NEEDED)
TRIG = kl.HermiteTrigDictionary(0)
HISTORY = kl.InputHistoryDictionary(TRIG, lags=(1, 2, 3, 4), product=True)  # 50 to 200 ms
ROBOTS = ("warthog", "husky")

# RMS after 1 s (longitudinal m, lateral m, heading rad), from the README beside the logs
NOMINAL = {"warthog": (0.525, 0.477, 0.808), "husky": (0.095, 0.185, 0.809)}
REFERENCE = {"warthog": (0.266, 0.199, 0.129), "husky": (0.113, 0.057, 0.145)}
# The reference does not say from which poses it predicts: its nominal rows, which no fit enters,
# differ from ours by up to 1 %, and starting at every 5th pose instead of every one moves each
# figure by as much. That is what equal means here.
SLACK = 1.02


@cache
def halves(robot: str, dt: float) -> tuple[kl.Dataset, kl.Dataset]:
    """Even and odd windows of at least 1.5 s."""
    windows = [e for e in kl.Dataset.load(LOGS / f"{robot}.csv").episodes if len(e) >= 30]
    even, odd = kl.Dataset(windows[0::2]), kl.Dataset(windows[1::2])
    return even.resample(dt), odd.resample(dt)


@cache
def report(
    robot: str, dictionary: kl.Dictionary, dt: float = 0.05, stride: int = 1
) -> kl.FitReport:
    """Errors on the odd windows of a model of the even ones."""
    train, held = halves(robot, dt)
    # the reference is the paper's free fit, which knows no symmetry
    model = kl.fit(train, dictionary, symmetric=False)
    return kl.evaluate(model, held, horizon=1.0, stride=stride)


def position_and_heading(errors: tuple[float, float, float]) -> np.ndarray:
    """Distance [m] and heading [rad]."""
    return np.array([np.hypot(errors[0], errors[1]), errors[2]])


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("stride", [1, 5])
def test_the_nominal_unicycle_errs_as_in_the_reference(robot: str, stride: int) -> None:
    np.testing.assert_allclose(
        report(robot, TRIG, stride=stride).nominal_multi_step, NOMINAL[robot], rtol=0.012
    )


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("stride", [1, 5])
def test_held_out_errors_are_at_or_below_the_reference(robot: str, stride: int) -> None:
    ours = position_and_heading(report(robot, TRIG, stride=stride).multi_step)
    assert (ours <= SLACK * position_and_heading(REFERENCE[robot])).all(), ours


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize(("dt", "lags"), [(0.05, (1, 2, 3, 4)), (0.1, (0, 1, 2))])
def test_input_history_helps(robot: str, dt: float, lags: tuple[int, ...]) -> None:
    without = position_and_heading(report(robot, TRIG, dt).multi_step)
    history = kl.InputHistoryDictionary(TRIG, lags=lags, product=True)
    assert (position_and_heading(report(robot, history, dt).multi_step) < without).all()
    assert (
        position_and_heading(REFERENCE[robot])
        > position_and_heading(report(robot, history, dt).multi_step)
    ).all()


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("dictionary", [TRIG, HISTORY])
def test_the_covariance_of_a_step_is_that_of_the_residuals(robot: str, dictionary: kl.Dictionary):
    train, held = halves(robot, 0.05)
    model = kl.fit(train, dictionary)
    for data, tolerance in ((train, 0.12), (held, 0.3)):
        u = np.concatenate([e.inputs[model.history :] for e in data.episodes])
        predicted = np.sqrt(np.diag(model.noise(u).mean(axis=0)))
        np.testing.assert_allclose(predicted, kl.evaluate(model, data).one_step, rtol=tolerance)


@cache
def chosen(robot: str) -> kl.KoopmanModel:
    """Lag and slip as the even windows support them."""
    return kl.fit(halves(robot, 0.1)[0], TRIG, lags="auto")


@pytest.mark.parametrize(
    ("robot", "largest"), [("husky", (0.99, 0.33, 0.21)), ("warthog", (0.5, 0.34, 0.17))]
)
def test_the_default_fit_beats_the_nominal_robot_in_every_direction(
    robot: str, largest: tuple[float, float, float]
) -> None:
    told = kl.evaluate(chosen(robot), halves(robot, 0.1)[1], horizon=1.0)
    ratio = np.array(told.multi_step) / told.nominal_multi_step
    assert (ratio <= largest).all(), ratio


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_default_fit_stands_still_and_its_noise_is_that_of_the_other_half(robot: str) -> None:
    model = chosen(robot)
    poses = np.random.default_rng(1).uniform(-9.0, 9.0, (20, 3))
    zeros = np.zeros((20, 2)), np.zeros((20, model.history, 2))
    np.testing.assert_array_equal(model.predict(poses, *zeros), poses)
    errors, inputs = prediction_errors(model, halves(robot, 0.1)[1])
    assert model.noise_model is not None and model.noise_model.sources is not None
    variances = model.noise_model.sources.as_array()
    expected = (design(inputs, 0.1) @ variances)[:, 4, :2]
    expected[:, 1] += (design_across(inputs, 0.1) @ variances[:, 2])[:, 4]
    squares = errors[:, 4, :2] ** 2  # half a second ahead
    assert expected.mean() == pytest.approx(squares.mean(), rel=0.4)
    within = (squares / np.maximum(expected, 1e-18)).sum(axis=1) < 5.991  # 95 % of a normal one
    assert 0.88 <= within.mean() <= 0.99
