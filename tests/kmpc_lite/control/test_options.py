"""Options are checked one by one, and refused by their names."""

import ast
import inspect
import re
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

import kmpc_lite as kl
from kmpc_lite.control import options as rooms

GROUPS = [group() for name, group in vars(rooms).items() if name.endswith("Options")]


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: type(group).__name__)
def test_a_value_that_is_none_is_refused_by_its_name(group: Any) -> None:
    for field in fields(group):
        wrong: list[Any] = ["much", None, (), [1.0]]
        if not isinstance(getattr(group, field.name), bool):
            wrong += [float("nan"), float("inf"), -1.0, True]
        for value in wrong:
            told = f"{type(group).__name__}.{field.name}: expected"
            with pytest.raises(kl.ProblemError, match=told):
                replace(group, **{field.name: value})


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: type(group).__name__)
def test_every_option_says_its_unit_or_reason(group: Any) -> None:
    nodes = ast.parse(inspect.getsource(type(group))).body[0].body  # type: ignore[attr-defined]
    for node, after in zip(nodes, [*nodes[1:], None], strict=True):
        assert not isinstance(node, ast.AnnAssign) or isinstance(after, ast.Expr), ast.unparse(node)


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
def test_what_is_wrong_in_a_table_is_reported_in_one_line(tables: dict[str, Any], words: str):
    with pytest.raises(kl.ProblemError, match=re.escape(words)) as refused:
        kl.ControllerOptions.from_dict(tables)
    assert "\n" not in str(refused.value)


def test_the_guide_to_scenario_files_names_every_room() -> None:
    page = (Path(__file__).parents[3] / "docs/howto/scenario_files.md").read_text(encoding="utf-8")
    told = page.partition("takes every option of")[2].partition("Unknown keys")[0]
    assert set(re.findall("`([a-z_]+)`", told)) == {f.name for f in fields(kl.ControllerOptions)}
