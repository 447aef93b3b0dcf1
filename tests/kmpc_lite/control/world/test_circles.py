"""Circles at the border, and distances and normals inside."""

from typing import Any

import numpy as np
import pytest

from kmpc_lite import Circle, ProblemError
from kmpc_lite.control.world.circles import circles_to_array

NAN, INF = float("nan"), float("inf")


@pytest.mark.parametrize(
    "values",
    [(NAN, 0, 1), (0, INF, 1), (0, 0, NAN), (0, 0, INF), (0, 0, 1, NAN, 0), (0, 0, 1, 0, -INF)],
)
def test_circles_must_be_finite(values: tuple[float, ...]) -> None:
    with pytest.raises(ProblemError, match="finite"):
        Circle(*values)


@pytest.mark.parametrize(
    "given_as",
    [
        [Circle(1, 2, 3, 4, 5)],
        [[1, 2, 3, 4, 5]],
        np.array([[1, 2, 3, 4, 5]]),
        (Circle(1, 2, 3, 4, 5),),
    ],
)
def test_rows_of_any_kind_become_one_array(given_as: Any) -> None:
    array = circles_to_array(given_as)
    np.testing.assert_array_equal(array, [[1, 2, 3, 4, 5]])
    assert array.dtype == float


@pytest.mark.parametrize(
    "wrong", [np.zeros(3), np.zeros((2, 4)), np.zeros((1, 2, 5)), np.zeros((0, 4)), 3.0, [[1, 2]]]
)
def test_other_shapes_are_refused_with_their_shape(wrong: Any) -> None:
    with pytest.raises(ValueError, match="shape"):
        circles_to_array(wrong)
