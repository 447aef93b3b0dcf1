"""Curves of Reeds and Shepp: they lead where they must, and are as short as known ones."""

import numpy as np
import pytest

from kmpc_lite.control.path.motions import chained, seen_from
from kmpc_lite.control.path.reeds_shepp import TURNS, curves

RNG = np.random.default_rng(4)
ENDS = np.column_stack([RNG.uniform(-6, 6, (300, 2)), RNG.uniform(-np.pi, np.pi, 300)])


def lengths(ends):
    return np.abs(curves(np.asarray(ends, dtype=float))).sum(axis=-1).min(axis=-1)


def test_every_word_leads_to_its_end():
    found = curves(ENDS)
    reached = np.isfinite(found).all(axis=-1)
    assert reached.any(axis=0).all() and reached.any(axis=1).all()
    steps = np.where(reached[..., None], found, 0.0)
    twists = np.stack([np.sign(steps), np.zeros_like(steps), np.sign(steps) * TURNS], axis=-1)
    ends = chained(np.zeros(3), twists, np.abs(steps))[..., -1, :]
    missed = ends - ENDS[:, None]
    missed[..., 2] = np.angle(np.exp(1j * missed[..., 2]))
    assert np.abs(missed[reached]).max() < 1e-9


def test_the_way_back_is_as_long_and_so_is_the_mirrored_one():
    back = np.array([seen_from(end, np.zeros(3)) for end in ENDS])
    np.testing.assert_allclose(lengths(back), lengths(ENDS), atol=1e-9)
    np.testing.assert_allclose(lengths(ENDS * (1, -1, -1)), lengths(ENDS), atol=1e-9)


@pytest.mark.parametrize(
    ("end", "length"),
    [
        ((3.0, 0.0, 0.0), 3.0),
        ((-3.0, 0.0, 0.0), 3.0),
        ((1.0, 1.0, np.pi / 2), np.pi / 2),
        # turning round in place takes three arcs of a sixth of a turn
        ((0.0, 0.0, np.pi), np.pi),
    ],
)
def test_known_lengths(end, length):
    assert lengths([end])[0] == pytest.approx(length)
