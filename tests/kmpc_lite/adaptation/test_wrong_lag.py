"""A lag that the model has wrong is no gain: it moves a way in time, not in length."""

import numpy as np
import pytest
from slipping_floors import DT, U_MAX

from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite import InputHistoryDictionary, UnicycleDictionary, fit
from kmpc_lite.adaptation.online import OnlineAdaptation


@pytest.mark.parametrize("lag", [0.1, 0.3])
@pytest.mark.parametrize("hold", [8, 20])
def test_gains_are_those_of_the_floor_where_the_lag_is_wrong_by_half(lag, hold):
    log = drive_log(LaggingDrive(lag=0.2), episodes=20, steps=300, seed=2)
    late = InputHistoryDictionary(UnicycleDictionary(), lags=tuple(range(6)))
    model, off = fit(log, late), []
    for seed in range(6):
        adaptation, random = OnlineAdaptation(model), np.random.default_rng(seed)
        x, plant = np.zeros(3), LaggingDrive(lag, slip=0.02, turn_gain=0.8, seed=seed)
        sent = np.zeros((5, 2))
        for k in range(300):
            u = random.uniform(-1, 1, 2) * U_MAX if k % hold == 0 else sent[-1]
            after = plant.step(x, u, DT)
            adaptation.update(x, u, after, sent)
            x, sent = after, np.vstack([sent[1:], u])
        off.append((adaptation.gains.ahead / 1.02 - 1.0, adaptation.gains.turn / 0.816 - 1.0))
    assert np.quantile(np.abs(off).max(axis=1), 0.8) < 0.05
