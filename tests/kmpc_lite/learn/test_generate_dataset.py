"""Training drives of the paper's robot: uniform, reproducible, with the slip of eq.

13 drawn anew every period.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl


def test_drives_are_uniform_and_reproducible() -> None:
    def make(seed: int) -> kl.Dataset:
        return kmpc_lab.generate_dataset(
            kmpc_lab.DifferentialDrive(0.1, seed=5),
            200,
            50,
            0.1,
            seed,
            u_max=(0.6, 0.8),
            x_max=(2.0, 1.0, 3.0),
        )

    data, again, other = make(1), make(1), make(2)
    assert len(data) == 200 and data.steps == 10_000 and data.dt == 0.1
    assert all(
        np.array_equal(a.states, b.states) and np.array_equal(a.inputs, b.inputs)
        for a, b in zip(data.episodes, again.episodes, strict=True)
    )
    assert not np.array_equal(data.episodes[0].inputs, other.episodes[0].inputs)
    starts, inputs = (
        np.array([e.states[0] for e in data.episodes]),
        np.concatenate([e.inputs for e in data.episodes]),
    )
    for values, limit in ((starts, [2.0, 1.0, 3.0]), (inputs, [0.6, 0.8])):
        share = values / limit
        assert np.abs(share).max() <= 1.0
        np.testing.assert_allclose(share.mean(axis=0), 0.0, atol=0.15)
        np.testing.assert_allclose(share.std(axis=0), 1 / np.sqrt(3), atol=0.05)


@pytest.mark.parametrize("slip", [0.03, 0.2])
def test_the_slip_is_that_of_the_paper(slip: float) -> None:
    dt, count = 1e-3, 20_000
    plant = kmpc_lab.DifferentialDrive(slip, seed=1)
    heading = 0.7
    moved = (
        plant.step(np.tile([0.0, 0.0, heading], (count, 1)), np.tile([1.0, 0.0], (count, 1)), dt)
        / dt
    )
    along, across = (
        np.cos(heading) * moved[:, 0] + np.sin(heading) * moved[:, 1],
        np.cos(heading) * moved[:, 1] - np.sin(heading) * moved[:, 0],
    )
    # x' = (v + beta v) cos + alpha v sin, y' = (v + beta v) sin - alpha v cos: it slips to the
    # right
    for ratio in (along - 1.0, -across):
        assert ratio.min() >= -1e-9
        assert ratio.mean() == pytest.approx(slip, rel=0.05) and ratio.std() == pytest.approx(
            slip, rel=0.05
        )
    turned = plant.step(np.zeros((count, 3)), np.tile([0.0, -1.0], (count, 1)), dt)[:, 2] / dt
    assert (-turned - 1.0).mean() == pytest.approx(slip, rel=0.05)


def test_every_robot_of_a_batch_slips_on_its_own() -> None:
    plant = kmpc_lab.DifferentialDrive(0.1, seed=2)
    ends = plant.step(np.zeros((50, 3)), [1.0, 1.0], 0.1)
    assert len(np.unique(ends[:, 0])) == 50
    assert plant.step(np.zeros(3), np.ones((4, 2)), 0.1).shape == (4, 3)
    one, next_one = (
        plant.step(np.zeros(3), [1.0, 1.0], 0.1),
        plant.step(np.zeros(3), [1.0, 1.0], 0.1),
    )
    assert not np.array_equal(one, next_one)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"episodes": 0}, "at least one episode"),
        ({"episodes": -1}, "at least one episode"),
        ({"steps": 0}, "at least one step"),
        ({"dt": 0.0}, "dt"),
        ({"dt": float("nan")}, "dt"),
    ],
)
def test_drives_that_are_none_are_refused(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(kl.DataError, match=words):
        kmpc_lab.generate_dataset(
            kmpc_lab.DifferentialDrive(), **{"episodes": 2, "steps": 3, "dt": 0.1, **arguments}
        )


def test_wrong_shapes_are_value_errors() -> None:
    for x, u in (
        (np.zeros(2), np.zeros(2)),
        (np.zeros(3), np.zeros(3)),
        (np.zeros((5, 3)), np.zeros((4, 2))),
    ):
        with pytest.raises(ValueError):
            kmpc_lab.DifferentialDrive().step(x, u, 0.1)
