"""Options know their units: what they refuse, and which of them grow with the robot."""

from dataclasses import fields
from typing import Any

import pytest

import kmpc_lite as kl
from kmpc_lite.control.options import (
    GoalOptions,
    GuidanceOptions,
    MovingObstacleOptions,
    lengths_from_radii,
)

GROUPS = (GuidanceOptions, GoalOptions, MovingObstacleOptions)


@pytest.mark.parametrize(
    ("group", "name", "value", "words"),
    [
        (GuidanceOptions, "wide_clearance", -0.1, r"a number >= 0 \[radii\], got -0.1"),
        (GuidanceOptions, "stall_time", "long", r"got 'long'"),
        (GuidanceOptions, "turn_share", True, "got True"),
        (GoalOptions, "averaging_time", None, "got None"),
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
