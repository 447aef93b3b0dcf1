"""Options are checked one by one, and told by their names where they are wrong."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError, fields, replace
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control import options as rooms
from kmpc_lite.control.options import fastest, unit_length

GROUPS = [
    getattr(rooms, name)() for name in rooms.__all__ if isinstance(getattr(rooms, name), type)
]
NUMBERS = [
    (group, field.name)
    for group in GROUPS
    for field in fields(group)
    if isinstance(getattr(group, field.name), int | float)
]


@pytest.mark.parametrize(("group", "name"), NUMBERS, ids=lambda value: str(value)[:30])
def test_a_number_that_is_none_is_refused_by_its_name(group: Any, name: str) -> None:
    if isinstance(getattr(group, name), bool):
        pytest.skip("a switch")
    for value in (float("nan"), float("inf"), -1.0, "much", None, True):
        with pytest.raises(kl.ProblemError, match=f"{type(group).__name__}.{name}: expected"):
            replace(group, **{name: value})


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: type(group).__name__)
def test_options_are_plain_frozen_data(group: Any) -> None:
    assert pickle.loads(pickle.dumps(group)) == group == type(group)()
    with pytest.raises(FrozenInstanceError):
        setattr(group, fields(group)[0].name, 1.0)


def test_every_option_says_its_unit_or_reason() -> None:
    import ast
    import inspect

    for group in GROUPS:
        body = ast.parse(inspect.getsource(type(group))).body[0].body  # type: ignore[attr-defined]
        for node, after in zip(body, [*body[1:], None], strict=True):
            if isinstance(node, ast.AnnAssign):
                told = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
                assert told, f"{type(group).__name__}.{ast.unparse(node.target)} has no docstring"


def test_a_radius_is_the_robots_and_a_points_the_papers() -> None:
    assert unit_length(kl.NavigationProblem(robot_radius=0.4)) == 0.4
    assert unit_length(kl.NavigationProblem(robot_radius=0.0)) == 0.15


def test_the_fastest_speeds_are_those_of_either_direction() -> None:
    problem = kl.NavigationProblem(u_min=(-0.8, -0.3), u_max=(0.5, 1.0))
    np.testing.assert_array_equal(fastest(problem), (0.8, 1.0))
