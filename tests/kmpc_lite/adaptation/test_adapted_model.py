"""What adaptation gives and keeps: gains that act as named, models and a state to be saved."""

import pickle

import numpy as np
import pytest
from slipping_floors import DT, go, model_of

from kmpc_lab import DifferentialDrive, generate_dataset
from kmpc_lite import (
    InputHistoryDictionary,
    KoopmanModel,
    UnicycleDictionary,
    fit,
    nominal_unicycle,
)
from kmpc_lite.adaptation.online import Gains, OnlineAdaptation
from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.errors import ModelError, ProblemError


def test_the_result_is_a_model_that_can_be_saved(tmp_path):
    adaptation = OnlineAdaptation(model_of(0.05))
    model = go(adaptation, DifferentialDrive(0.05, seed=1, turn_gain=0.6), 100, 0)[-1]
    model.save(tmp_path / "adapted.npz")
    loaded = KoopmanModel.load(tmp_path / "adapted.npz")
    assert loaded.info["adaptation"]["turn"] == adaptation.gains.turn
    x, u = np.array([0.1, 0.2, 0.3]), np.array([0.5, -0.4])
    np.testing.assert_array_equal(loaded.predict(x, u), model.predict(x, u))
    # and it is where a further drive can begin
    again = OnlineAdaptation(loaded)
    assert not go(again, DifferentialDrive(0.05, seed=6, turn_gain=0.6), 300, 5)


def test_gains_act_as_named():
    base = nominal_unicycle(DT)
    adaptation = OnlineAdaptation(base)
    go(adaptation, DifferentialDrive(), 30, 0)
    model = adaptation._give(Gains(ahead=1.2, left=-0.1, turn=0.5, pull=0.3))
    # no turn while it is driven, so that the displacement can be read off
    end = model.with_dt(1e-4).predict(np.zeros(3), np.array([1.0, 1.0])) / 1e-4
    np.testing.assert_allclose(end, [1.2, -0.1, 0.8], atol=1e-3)
    assert adaptation._give(Gains(ahead=5.0)) is None and adaptation._give(Gains(turn=-1.0)) is None
    adaptation.reset()
    assert (
        adaptation.model is base and adaptation.gains == Gains() and adaptation.counts.models == 0
    )


def test_bad_arguments():
    data = generate_dataset(DifferentialDrive(0.05), episodes=10, steps=50, dt=DT)
    with pytest.raises(ModelError, match="needs a continuous model"):
        OnlineAdaptation(fit(data, method="edmdc"))
    with pytest.raises(ProblemError, match="window < memory"):
        OnlineAdaptation(nominal_unicycle(DT), AdaptationOptions(window=5.0, memory=5.0))
    adaptation = OnlineAdaptation(nominal_unicycle(DT))
    with pytest.raises(ValueError, match="expected x"):
        adaptation.update((0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0))
    slow = OnlineAdaptation(fit(data, InputHistoryDictionary(UnicycleDictionary(), lags=(0, 1))))
    with pytest.raises(ValueError, match="history"):
        slow.update(np.zeros(3), np.zeros(2), np.zeros(3), np.zeros((3, 2)))


def test_its_state_copies_and_pickles_to_the_last_bit():
    adaptation = OnlineAdaptation(model_of(0.05))
    plant = DifferentialDrive(0.2, seed=3, turn_gain=0.7)
    go(adaptation, plant, 45, 1)
    other = pickle.loads(pickle.dumps(adaptation))
    for each in (adaptation, other):
        go(each, DifferentialDrive(0.2, seed=4, turn_gain=0.7), 200, 2)
    assert adaptation.gains == other.gains and adaptation.counts == other.counts
    np.testing.assert_array_equal(adaptation.state.raw, other.state.raw)
