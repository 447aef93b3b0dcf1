"""A model is compared with the nominal robot on a drive: better, worse, alike, or not known yet."""

from dataclasses import replace

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite.learn.evaluation import ModelVerdict, compare

DT = 0.1


def drive(
    gain: float = 1.0, seconds: float = 20.0, seed: int = 5, noise: float = 0.004
) -> kl.Dataset:
    """A robot whose turns come out at a share of the commands."""
    clean = drive_log(LaggingDrive(turn_gain=gain), 1, round(seconds / DT), DT, seed, hold=8)
    random = np.random.default_rng(seed)
    (episode,) = clean.episodes
    states = episode.states + noise * random.normal(size=episode.states.shape)
    return kl.Dataset([kl.Episode(states, episode.inputs, DT)])


def learned(gain: float) -> kl.KoopmanModel:
    """A model of such a robot."""
    return kl.fit(drive(gain, 60.0, 1), kl.HermiteTrigDictionary(0))


@pytest.mark.parametrize("seed", range(3))
def test_the_model_of_a_robot_that_is_not_nominal_is_better(seed: int) -> None:
    result = compare(learned(0.7), drive(0.7, seed=seed).episodes)
    assert result.verdict is ModelVerdict.BETTER and result.errors[2] < 0.3 * result.nominal[2]
    assert "predicts better than the nominal robot (" in str(result)


@pytest.mark.parametrize("seed", range(3))
def test_a_model_that_differs_by_less_than_the_noise_is_alike(seed: int) -> None:
    result = compare(learned(1.0), drive(1.0, seed=seed).episodes)
    assert result.verdict in (ModelVerdict.ALIKE, ModelVerdict.BETTER)
    same = compare(kl.nominal_unicycle(DT), drive(1.0, seed=seed).episodes)
    assert same.verdict is ModelVerdict.ALIKE


def test_a_short_drive_and_a_robot_that_stands_say_nothing() -> None:
    model = learned(0.7)
    assert compare(model, drive(0.7, seconds=5.0).episodes).verdict is ModelVerdict.SHORT
    assert compare(model, []).verdict is ModelVerdict.SHORT
    stands = kl.Episode(np.zeros((301, 3)), np.zeros((300, 2)), DT)
    assert compare(model, [stands]).windows == 0


def test_a_model_that_diverges_is_worse() -> None:
    model = kl.fit(drive(0.7, 60.0, 1))
    wild = replace(model, A=1e6 * np.ones_like(model.A))
    assert compare(wild, drive(0.7).episodes).verdict is ModelVerdict.WORSE
