"""Commands of given ages: how much of each acts, and that a model of them leads where it should."""

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite.learn.cross_validation import SelectionOptions
from kmpc_lite.learn.responses import AgedResponse, shares_of_ages
from kmpc_lite.learn.selection import cut_for
from kmpc_lite.model.dictionary.response import ResponseDictionary

DT = 0.1
SPEED, TURN = (0.1, 0.6, 0.3), (0.5, 0.2, 0.3)
TRIG = kl.HermiteTrigDictionary(0)


def answering_log(
    speed: tuple[float, ...] = SPEED,
    turn: tuple[float, ...] = TURN,
    noise: float = 0.0,
    by: float = 1.0,
    turns: float = 1.0,
) -> kl.Dataset:
    """Driving of a robot that answers with these shares, and turns by 0.8 of the command."""
    random, episodes = np.random.default_rng(5), []
    dictionary = ResponseDictionary(TRIG, speed, turn)
    nominal = kl.nominal_unicycle(DT)
    for _ in range(24):
        held = random.uniform(-0.8, 0.8, (8, 2)) * (by, turns)
        sent = np.repeat(held, 8, axis=0)
        padded = np.concatenate([np.zeros((dictionary.history, 2)), sent])
        past = np.stack([padded[k : k + dictionary.history] for k in range(len(sent))])
        acting = dictionary.answered(sent, past) * (1.0, 0.8)
        poses = nominal.rollout(random.uniform(-1, 1, 3), acting)
        poses += random.normal(size=poses.shape) * (noise * by, noise * by, noise)
        episodes.append(kl.Episode(poses, sent, DT))
    return kl.Dataset(episodes)


def shares(data: kl.Dataset, ages: tuple[int, ...]) -> tuple[AgedResponse, AgedResponse]:
    return shares_of_ages(cut_for(data, SelectionOptions(), ages), ages)


@pytest.mark.parametrize("ages", [(0, 1, 2), (0, 1, 2, 3, 4), (2, 0, 1)])
def test_shares_are_those_that_made_the_log(ages: tuple[int, ...]) -> None:
    for found, made in zip(shares(answering_log(), ages), (SPEED, TURN), strict=True):
        whole = (*made, *np.zeros(max(ages) - 2))
        np.testing.assert_allclose(found.shares, whole, atol=1e-4)
        assert found.delay == pytest.approx(DT * (made[1] + 2.0 * made[2]), abs=1e-5)


def test_a_log_without_turns_says_nothing_of_how_late_they_are() -> None:
    speed, turn = shares(answering_log(turns=0.0), (0, 1, 2))
    np.testing.assert_allclose(speed.shares, SPEED, atol=1e-4)
    np.testing.assert_allclose(turn.shares, np.full(3, 1.0 / 3.0))


def test_a_robot_that_sets_off_goes_straight_ahead() -> None:
    """Weights of their own for every age and direction lead it aside where its speed changes."""
    robot = LaggingDrive(0.1, 0.05, 0.05, seed=3)
    data = drive_log(robot, 12, 100, DT, 7, hold=20, pose_noise=(0.01, 0.01, 0.02))

    def aside(model: kl.KoopmanModel) -> float:
        inputs = np.tile((0.5, 0.0), (model.history, 1))
        poses = model.rollout(np.zeros(3), inputs, np.zeros((model.history, 2)))
        # the slip of its floor leads a straight drive aside by a twentieth
        return float(np.abs(np.diff(poses[:, 1]) + 0.05 * np.diff(poses[:, 0])).max())

    ages = (0, 1, 2, 3)
    given, free = kl.fit(data, TRIG, lags=ages), kl.fit(data, kl.InputHistoryDictionary(TRIG, ages))
    assert given.history == free.history == 3
    assert aside(given) < 1e-3 and aside(free) > 4.0 * aside(given)
    assert "selection" in given.info and "selection" not in free.info


def test_a_model_of_ages_predicts_as_well_as_one_that_finds_them() -> None:
    robot = LaggingDrive(0.12, 0.1, 0.05, seed=3)
    data = drive_log(robot, 24, 100, DT, 7, hold=10, pose_noise=(0.003, 0.003, 0.006))
    train, held = data.split(0.5, seed=1)
    ours = kl.evaluate(kl.fit(train, TRIG, lags=(0, 1, 2, 3, 4)), held).multi_step
    found = kl.evaluate(kl.fit(train, TRIG, lags="auto"), held).multi_step
    assert (np.array(ours) < 1.1 * np.array(found)).all()


def test_ages_that_cannot_be_are_refused() -> None:
    for ages in ((0, 0), (-1,), (10**9,)):
        with pytest.raises(kl.ModelError, match="lags must be different integers"):
            kl.fit(answering_log(), TRIG, lags=ages)


def test_a_log_that_is_too_short_for_them_is_refused_with_what_they_need() -> None:
    short = kl.Dataset(answering_log().windows(1.5).episodes)
    with pytest.raises(kl.DataError, match=r"pieces of driving longer than 1\.8 s .* got 0"):
        kl.fit(short, TRIG, lags=(0, 8))


def test_an_omni_is_told_that_its_lag_is_found_by_itself() -> None:
    random = np.random.default_rng(2)
    poses = np.cumsum(random.normal(size=(301, 3)), axis=0) * 0.05
    log = kl.Dataset([kl.Episode(poses, random.normal(size=(300, 3)), DT)])
    with pytest.raises(kl.DataError, match="an omni's lag is found by itself"):
        kl.fit(log, kl.HermiteTrigDictionary(0, commands=3), lags=(0, 1))
