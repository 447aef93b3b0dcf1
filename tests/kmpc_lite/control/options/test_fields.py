"""Options know their units: what they refuse, and which of them grow with the robot."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import pytest

import kmpc_lite as kl
from kmpc_lite.control.options import (
    GoalOptions,
    GuidanceOptions,
    MovingObstacleOptions,
    SightOptions,
    lengths_from_radii,
)

GROUPS = (GuidanceOptions, GoalOptions, MovingObstacleOptions)


@pytest.mark.parametrize(
    ("group", "name", "value", "words"),
    [
        (GuidanceOptions, "wide_clearance", -0.1, r"a number >= 0 \[radii\], got -0.1"),
        (GuidanceOptions, "stall_time", float("nan"), r"a number >= 0 \[s\], got nan"),
        (GuidanceOptions, "stall_time", "long", r"got 'long'"),
        (GuidanceOptions, "hurried_parts", 0, "a whole number >= 1, got 0"),
        (GuidanceOptions, "hurried_parts", 2.0, "a whole number >= 1, got 2.0"),
        (GuidanceOptions, "turn_share", True, "got True"),
        (GuidanceOptions, "hurried_parts", 0, "a whole number >= 1, got 0"),
        (SightOptions, "passes", 128, "a whole number from 1 to 127, got 128"),
        (GoalOptions, "averaging_time", None, "got None"),
        (MovingObstacleOptions, "speed_scales", (), "a tuple of finite numbers"),
        (MovingObstacleOptions, "speed_scales", (1.0, float("inf")), "a tuple of finite numbers"),
    ],
)
def test_what_is_no_such_number_is_refused_in_one_line(
    group: Any, name: str, value: Any, words: str
) -> None:
    with pytest.raises(
        kl.ProblemError, match=rf"^{group.__name__}\.{name}: expected .*"
    ) as refused:
        group(**{name: value})
    refused.match(words)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("group", "name"),
    [
        (GuidanceOptions, "turn_share"),
        (SightOptions, "cell"),
    ],
)
def test_what_something_is_divided_by_is_not_zero(group: Any, name: str) -> None:
    with pytest.raises(kl.ProblemError, match=rf"{name}: expected a number > 0 .*, got 0.0$"):
        group(**{name: 0.0})


@pytest.mark.parametrize("group", GROUPS)
def test_lengths_alone_grow_with_the_robot(group: Any) -> None:
    plain, large = group(), lengths_from_radii(group(), 0.5)
    for f in fields(group):
        factor = 0.5 if f.metadata["unit"] == "radii" else 1.0
        value = getattr(plain, f.name)
        expected = value if isinstance(value, tuple | int) else factor * value
        assert getattr(large, f.name) == expected


@pytest.mark.parametrize("group", GROUPS)
def test_options_do_not_change(group: Any) -> None:
    with pytest.raises(AttributeError):
        setattr(group(), fields(group)[0].name, 1.0)
