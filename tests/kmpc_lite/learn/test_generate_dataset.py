"""Training drives of the paper's robot: uniform, reproducible, with the slip of eq.

13 drawn anew every period.
"""

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


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"episodes": 0}, "at least one episode"),
        ({"steps": 0}, "at least one step"),
        ({"dt": float("nan")}, "dt"),
    ],
)
def test_drives_that_are_none_are_refused(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(kl.DataError, match=words):
        kmpc_lab.generate_dataset(
            kmpc_lab.DifferentialDrive(), **{"episodes": 2, "steps": 3, "dt": 0.1, **arguments}
        )
