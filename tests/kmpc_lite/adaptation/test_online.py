"""A changed floor is learned within seconds, and what a drive does not show is not unlearned."""

from dataclasses import replace

import numpy as np
import pytest
from slipping_floors import DT, U_MAX, errors, go, learned, model_of

from kmpc_lab import DifferentialDrive, generate_dataset
from kmpc_lite import InputHistoryDictionary, UnicycleDictionary, fit, nominal_omni
from kmpc_lite.adaptation.online import Gains, OnlineAdaptation


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ((0.0, 1.0), (0.2, 1.0)),
        ((0.05, 1.0), (0.2, 1.0)),
        ((0.05, 1.0), (0.05, 0.6)),
        ((0.2, 1.0), (0.2, 0.6)),
    ],
)
def test_a_changed_floor_is_learned_in_five_seconds(before, after):
    fresh = errors(learned(*after, seed=9), *after)
    ratios = []
    for seed in range(6):
        adaptation = OnlineAdaptation(model_of(*before))
        known = DifferentialDrive(before[0], seed=seed, turn_gain=before[1])
        assert not go(adaptation, known, 300, seed)
        changed = DifferentialDrive(after[0], seed=seed + 50, turn_gain=after[1])
        assert len(go(adaptation, changed, 50, seed + 100)) <= 8
        ratios.append(errors(adaptation.model, *after) / fresh)
    assert np.median(ratios, axis=0).max() <= 1.15
    assert np.max(ratios) <= 1.5
    stale = errors(model_of(*before), *after) / fresh
    assert stale.max() > 1.2
    assert np.median(ratios, axis=0).max() < 0.9 * stale.max()


def test_a_straight_line_does_not_unlearn_turning():
    adaptation = OnlineAdaptation(model_of(0.05))
    straight, noise = np.tile([0.5, 0.0], (3000, 1)), (0.002, 0.002, 0.01)
    go(adaptation, DifferentialDrive(0.2, seed=2), 3000, 1, noise, straight)
    # the slip ahead and sideways is learned; of the turns nothing was seen
    assert adaptation.gains.ahead == pytest.approx(1.2 / 1.05, abs=0.05)
    assert adaptation.gains.turn == pytest.approx(1.0, abs=0.02)
    go(adaptation, DifferentialDrive(0.2, seed=3), 150, 2)
    assert adaptation.gains.turn == pytest.approx(1.2 / 1.05, abs=0.1)


def test_turning_on_the_spot_does_not_unlearn_driving():
    adaptation, turning = OnlineAdaptation(model_of(0.05)), np.tile([0.0, 0.6], (1000, 1))
    plant = DifferentialDrive(0.05, seed=2, turn_gain=0.6)
    go(adaptation, plant, 1000, 1, commands=turning)
    assert adaptation.gains.turn == pytest.approx(0.6, abs=0.03)
    assert adaptation.gains[:2] == pytest.approx((1.0, 0.0), abs=0.02)


def test_with_input_history():
    """A robot that obeys one period late, and whose turns then shrink."""
    late = InputHistoryDictionary(UnicycleDictionary(), lags=(0, 1))
    random, plant = np.random.default_rng(0), DifferentialDrive(0.02, seed=1)
    data = generate_dataset(plant, episodes=100, steps=200, dt=DT, seed=2)
    delayed = type(data)(
        [replace(e, inputs=np.vstack([e.inputs[1:], e.inputs[:1]])) for e in data.episodes]
    )
    adaptation = OnlineAdaptation(fit(delayed, late))
    x, past = np.zeros(3), np.zeros((1, 2))
    for k in range(400):
        if k % 60 == 0:
            x = random.uniform(-1, 1, 3)
        u = random.uniform(-1, 1, 2) * U_MAX
        plant.turn_gain = 0.6 if k >= 200 else 1.0
        after = plant.step(x, past[0], DT)
        given = adaptation.update(x, u, after, past)
        assert given is None or k >= 200
        x, past = after, u[None]
    assert adaptation.gains.turn == pytest.approx(0.6, abs=0.02)


def test_an_omni_that_goes_sideways_otherwise_than_ahead_has_one_model_in_all_directions():
    """Rollers give a tenth less of a way sideways: no direction contradicts what others showed."""
    model, random = nominal_omni(DT), np.random.default_rng(0)
    adaptation, x, found = OnlineAdaptation(model), np.zeros(3), []
    happens = np.array((1.0, 0.9, 0.95))
    for k in range(200):
        if k % 25 == 0:
            u = random.uniform(-1, 1, 3) * (0.6, 0.6, 1.5)
        after = model.predict(x, u * happens)
        adaptation.update(x, u, after)
        found.append(adaptation.gains)
        x = after
    expected = np.tile(Gains(turn=0.95, aside=0.9), (100, 1))
    np.testing.assert_allclose(found[100:], expected, atol=1e-2)
    moved = adaptation.model.predict(x, u)
    np.testing.assert_allclose(moved, model.predict(x, u * happens), atol=1e-3)
