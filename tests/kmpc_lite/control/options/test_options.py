"""Options are checked one by one, and told by their names where they are wrong."""

from __future__ import annotations

import pickle
import re
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control import options as rooms
from kmpc_lite.control.options import fastest, unit_length
from kmpc_lite.gone_options import GONE

GROUPS = [
    getattr(rooms, name)() for name in rooms.__all__ if isinstance(getattr(rooms, name), type)
]


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: type(group).__name__)
def test_a_value_that_is_none_is_refused_by_its_name(group: Any) -> None:
    for field in fields(group):
        wrong: list[Any] = ["much", None, (), [1.0]]
        if not isinstance(getattr(group, field.name), bool):
            wrong += [float("nan"), float("inf"), -1.0, True]
        for value in wrong:
            with pytest.raises(
                kl.ProblemError, match=f"{type(group).__name__}.{field.name}: expected"
            ):
                replace(group, **{field.name: value})


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


def test_tables_of_a_file_make_options_and_what_was_changed_makes_the_tables() -> None:
    tables = {
        "guidance": {"lead_time": 0.3},
        "solver": {"real_time": {"max_iter": 80}},
        "moving_obstacles": {"speed_scales": [0.5, 0.0]},
    }
    options = kl.ControllerOptions.from_dict(tables)
    assert options.solver.real_time == replace(rooms.OSQPOptions(), max_iter=80)
    assert options.moving_obstacles.speed_scales == (0.5, 0.0)
    assert kl.ControllerOptions.from_dict(options.changed()) == options
    assert set(options.changed()) == set(tables)
    assert kl.ControllerOptions().changed() == {}


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"gidance": {}}, "options.gidance: unknown; did you mean 'guidance'?"),
        ({"moon": {}}, "options.moon: unknown; expected one of guidance, goal"),
        ({"solver": {"reel_time": {}}}, "options.solver.reel_time: unknown; did you mean"),
        ({"solver": 3}, "options.solver: expected a table, got 3"),
        ({"guidance": {"lead_time": -1.0}}, "options.guidance: GuidanceOptions.lead_time: expec"),
        ({"solver": {"real_time": {"max_iter": 0}}}, "expected a whole number >= 1, got 0"),
    ],
)
def test_what_is_wrong_in_a_table_is_told_in_one_line(tables: dict[str, Any], words: str) -> None:
    with pytest.raises(kl.ProblemError, match=re.escape(words)) as refused:
        kl.ControllerOptions.from_dict(tables)
    assert "\n" not in str(refused.value)


def test_an_option_of_an_earlier_version_is_understood_and_what_took_its_place_told() -> None:
    assert GONE
    for place, instead in GONE.items():
        room, name = place.split(".")
        with pytest.warns(UserWarning, match=re.escape(instead)):
            options = kl.ControllerOptions.from_dict({room: {name: 1}})
        assert options == kl.ControllerOptions()
        assert not hasattr(getattr(options, room), name)


@pytest.mark.parametrize(
    ("dt", "oldest"), [(0.1, 2.0), (0.001, 1.0), (1e-4, 0.1)], ids=["seconds", "periods", "short"]
)
def test_a_pose_is_believed_for_two_seconds_or_a_thousand_periods(dt: float, oldest: float) -> None:
    model, problem = kl.nominal_unicycle(dt), kl.NavigationProblem(dt=dt)
    kl.Controller(model, problem, pose_age=0.999 * oldest)
    with pytest.raises(kl.ProblemError, match=f"pose_age: expected a time from 0 to {oldest:g} s"):
        kl.Controller(model, problem, pose_age=1.001 * oldest)


@pytest.mark.parametrize("dt", [0.99e-4, 101.0])
def test_periods_lie_between_a_tenth_of_a_millisecond_and_a_hundred_seconds(dt: float) -> None:
    with pytest.raises(kl.ProblemError, match="dt: expected a period from 0.0001 to 100 s"):
        kl.Controller(kl.nominal_unicycle(dt), kl.NavigationProblem(dt=dt))


def test_the_guide_to_scenario_files_names_every_room() -> None:
    page = Path(__file__).parents[4] / "docs/howto/scenario_files.md"
    told = page.read_text(encoding="utf-8").split("takes every option of")[1].split("A run")[0]
    assert set(re.findall("`([a-z_]+)`", told)) == {f.name for f in fields(kl.ControllerOptions)}


def test_a_controller_adapts_as_its_options_say() -> None:
    options = kl.ControllerOptions.from_dict({"adaptation": {"window": 3.0}})
    adaptation = kl.Controller(kl.nominal_unicycle(0.1), options=options).adaptation
    assert adaptation is not None and adaptation.options.window == 3.0


def test_times_are_the_robots_but_where_sensors_and_computers_set_the_pace() -> None:
    by_the_clock = {
        f"{type(group).__name__}.{field.name}"
        for group in GROUPS
        for field in fields(group)
        if field.metadata["unit"] == "s by the clock"
    }
    assert by_the_clock == {
        "SightOptions.blind_time",
    }


def test_an_option_that_is_gone_is_named_with_what_took_its_place() -> None:
    with pytest.warns(UserWarning, match="options.stop.slower_shares: not an option any more; the"):
        options = kl.ControllerOptions.from_dict({"stop": {"slower_shares": [0.5]}})
    assert options == kl.ControllerOptions()
    for name in GONE:
        room, option = name.split(".")
        assert not hasattr(getattr(options, room), option)
