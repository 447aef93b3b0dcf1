"""The closed form of a symmetric model is its bilinear form, and no other model has one."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from any_model import DICTIONARIES

import kmpc_lite as kl


@pytest.mark.parametrize("integrator", ["rk4", "midpoint"])
@pytest.mark.parametrize("name", sorted(DICTIONARIES))
def test_closed_form_of_a_symmetric_model_is_its_bilinear_form(name: str, integrator: str) -> None:
    from kmpc_lite.learn.least_squares import symmetric_generator

    dictionary, random = DICTIONARIES[name], np.random.default_rng(5)
    nz, nw = dictionary.size, dictionary.input_size
    h = symmetric_generator(dictionary, *random.normal(size=(3, nw)))
    pull = np.zeros((3, nw))
    pull[2] = random.normal(size=nw)
    parts = np.zeros((3, nz)), pull, h, np.eye(3)
    closed = kl.KoopmanModel(dictionary, 0.2, *parts, continuous=True, integrator=integrator)
    assert closed.closed_form is not None
    free = replace(closed)
    object.__setattr__(free, "closed_form", None)
    x, u = random.normal(size=(2, 7, 3)), random.normal(size=(2, 7, 2))
    past = random.normal(size=(2, 7, dictionary.history, 2))
    assert_close = partial(np.testing.assert_allclose, rtol=1e-12, atol=1e-13)
    assert_close(closed.predict(x, u, past), free.predict(x, u, past))
    assert_close(closed.predict(x[0, 0], u[0, 0], past[0, 0]), free.predict(x, u, past)[0, 0])
    for mine, theirs in zip(closed.linearize(x, u, past), free.linearize(x, u, past), strict=True):
        assert_close(mine, theirs)
    assert_close(closed.rollout(x[:, 0], u, past[:, 0]), free.rollout(x[:, 0], u, past[:, 0]))
    assert_close(closed.rollout(x[0, 0], u[0]), free.rollout(x[0, 0], u[0]))


@pytest.mark.parametrize("place", [("A", 0, 3), ("B", 1, 0), ("H", 0, 4), ("H", 1, 2), ("H", 2, 1)])
def test_a_model_that_is_not_symmetric_has_no_closed_form(place: tuple[str, int, int]) -> None:
    name, row, column = place
    symmetric = kl.nominal_unicycle(0.1)
    matrix = getattr(symmetric, name).copy()
    matrix[row, column] += 1e-6
    other = replace(symmetric, **{name: matrix})
    assert other.closed_form is None
    assert not np.array_equal(
        other.predict([0.4, 0.2, 0.9], [0.5, 0.3]), symmetric.predict([0.4, 0.2, 0.9], [0.5, 0.3])
    )


def test_displacement_along_measured_headings_is_the_generator_integrated_by_simpson() -> None:
    random = np.random.default_rng(8)
    model = replace(kl.nominal_unicycle(0.2), B=np.array([[0.0, 0.0], [0.0, 0.0], [0.3, -0.2]]))
    assert model.closed_form is not None
    heading, turned, w = 0.7, -0.9, random.normal(size=2)
    x, y, turn, ahead = model.closed_form.displacement(heading, turned, w)
    poses = np.zeros((3, 3))
    poses[:, 2] = heading + turned * np.array((0.0, 0.5, 1.0))
    z = model.dictionary.lift(poses)
    blocks = model.H.reshape(3, 2, -1)
    rates = np.einsum("ran,a,tn->tr", blocks, w, z) + model.B @ w
    expected = 0.2 * np.array((1.0, 4.0, 1.0)) @ rates / 6.0
    np.testing.assert_allclose((x, y, turn), expected, rtol=1e-12)
    assert ahead == pytest.approx(0.2 * w[0])
