"""Held-out errors: what a known fault must show, in which column, and from how many starts."""

from typing import Any

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl

INTEGRATION = 1e-8
"""What Runge-Kutta steps of 0.1 s are off the exact arcs that the robot drives, over a few seconds
[m, rad]."""


def drives(
    episodes: int = 6, steps: int = 40, dt: float = 0.1, slip: float = 0.0, seed: int = 0
) -> kl.Dataset:
    """Random driving."""
    return kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(slip, seed), episodes=episodes, steps=steps, dt=dt, seed=seed
    )


def test_a_bias_over_the_horizon_is_seen_from_the_starting_pose() -> None:
    # a robot 10 % faster than commanded, along an arc that ends pointing left of its start
    v, omega, dt, steps = 0.5, 0.8, 0.1, 10
    path = kl.nominal_unicycle(dt).rollout([1.0, 2.0, 2.5], np.tile([1.1 * v, omega], (steps, 1)))
    report = kl.evaluate(
        kl.nominal_unicycle(dt),
        kl.Dataset([kl.Episode(path, np.tile([v, omega], (steps, 1)), dt)]),
        horizon=1.0,
    )
    missed = 0.1 * v / omega * np.array([np.sin(0.8), 1 - np.cos(0.8)])
    np.testing.assert_allclose(report.multi_step, [*missed, 0.0], atol=1e-6)
    assert report.starts == 1


def test_every_start_is_used_once_whatever_the_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    data = kl.Dataset(
        [
            *drives(3, 40, slip=0.1).episodes,
            *drives(2, 15, slip=0.1).episodes,
            *drives(4, 5, slip=0.1).episodes,
        ]
    )
    model = kl.nominal_unicycle(0.1)
    whole = kl.evaluate(model, data, horizon=1.0)
    assert whole.starts == 3 * 31 + 2 * 6 and whole.horizon == pytest.approx(1.0)
    errors = []
    for e in data.episodes:
        for s in range(len(e) - 9):
            end = model.rollout(e.states[s], e.inputs[s : s + 10])[-1] - e.states[s + 10]
            cos, sin = np.cos(e.states[s, 2]), np.sin(e.states[s, 2])
            errors.append([cos * end[0] + sin * end[1], cos * end[1] - sin * end[0], end[2]])
    np.testing.assert_allclose(
        whole.multi_step, np.sqrt(np.mean(np.square(errors), axis=0)), rtol=1e-9
    )
    for chunk in (1, 7, 50):
        monkeypatch.setattr(kl.Dataset.pieces, "__defaults__", (0, 1, chunk))
        parts = kl.evaluate(model, data, horizon=1.0)
        np.testing.assert_allclose(
            parts.multi_step + parts.one_step, whole.multi_step + whole.one_step, rtol=1e-12
        )
        assert parts.starts == whole.starts
    assert kl.evaluate(model, data, horizon=1.0, stride=5).starts == 3 * 7 + 2 * 2


@pytest.mark.parametrize(
    ("model", "horizon", "stride", "words"),
    [
        (
            kl.nominal_unicycle(0.1),
            4.1,
            1,
            r"as long as 4.1 s plus an input history of 0 steps \(longest 4 s\)",
        ),
        (kl.nominal_unicycle(0.2), 1.0, 1, "dataset's dt is 0.1 s, the model's 0.2 s"),
        (kl.nominal_unicycle(0.1), float("nan"), 1, "horizon"),
        (kl.nominal_unicycle(0.1), 1.0, 0, "stride"),
        (kl.nominal_unicycle(0.1), 1.0, 1.5, "stride"),
    ],
)
def test_what_cannot_be_evaluated(model: kl.KoopmanModel, horizon: float, stride: Any, words: str):
    with pytest.raises(kl.DataError, match=words):
        kl.evaluate(model, drives(), horizon, stride)


@pytest.mark.filterwarnings("error")
def test_a_model_that_diverges_has_an_infinite_error_and_raises_no_warning() -> None:
    wild = kl.KoopmanModel(
        kl.HermiteTrigDictionary(4),
        0.1,
        np.ones((3, 105)),
        np.zeros((3, 2)),
        np.ones((3, 210)),
        np.eye(3),
        continuous=True,
    )
    report = kl.evaluate(wild, drives(), horizon=3.0)
    assert (
        report.multi_step == (np.inf, np.inf, np.inf)
        and max(report.nominal_multi_step) < INTEGRATION
    )
