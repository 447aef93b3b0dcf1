"""Footprints in scenario files."""

from typing import Any

import pytest

from kmpc_lite.control import Footprint
from kmpc_lite.errors import ScenarioError
from kmpc_lite.reading import parse_toml
from kmpc_lite.scenario.files import Scenario


def scenario(start: tuple[float, float, float], footprint: Any) -> Scenario:
    table = {
        "map": {"bounds": [-2, -2, 2, 2], "circles": [[0.0, 0.0, 0.2]]},
        "robot": {"footprint": footprint, "start": list(start), "goal": [1.5, 1.5, 0.0]},
    }
    return Scenario.from_table(table, "cart", "cart.toml")


def test_is_read_and_written() -> None:
    made = scenario((-1.0, 0.0, 0.0), {"length": 0.8, "width": 0.3, "ahead": -0.2})
    assert made.footprint == Footprint.rectangle(0.8, 0.3, -0.2)
    assert made.radius == made.footprint.radius
    assert made.problem().footprint == made.footprint
    again = Scenario.from_table(parse_toml(made.to_toml()), "cart", "again")
    assert again.footprint == made.footprint and again.radius == made.radius


def test_may_stand_where_its_circle_could_not() -> None:
    # 0.2 m beside the circle's edge, along it
    made = scenario((0.0, -0.4, 0.0), {"length": 0.8, "width": 0.3})
    assert made.radius > 0.4
    with pytest.raises(ScenarioError, match=r"cart: \[robot\] start: .* overlaps an obstacle by"):
        scenario((0.0, -0.4, 1.57), {"length": 0.8, "width": 0.3})


@pytest.mark.parametrize(
    ("footprint", "expected"),
    [
        ({"length": 0.8}, r"cart.toml: \[robot\] footprint: footprint: expected corners"),
        ([[0, 0], [1, 0]], "footprint: expected at least 3 corners"),
        ({"length": 1e9, "width": 1.0}, "footprint: expected at most 1e"),
    ],
)
def test_wrong_ones_are_reported(footprint: Any, expected: str) -> None:
    with pytest.raises(ScenarioError, match=expected):
        scenario((-1.0, 0.0, 0.0), footprint)
