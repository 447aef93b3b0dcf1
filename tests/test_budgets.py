"""The ratchet on the project's size: one line too many turns it red, and limits only go down."""

import importlib.util
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / ".ci" / "budgets.py"
spec = importlib.util.spec_from_file_location("budgets", SOURCE)
assert spec is not None and spec.loader is not None
budgets = importlib.util.module_from_spec(spec)
spec.loader.exec_module(budgets)


@pytest.mark.parametrize(
    ("count", "limit", "before", "said"),
    [
        (1000, 1000, 1000, None),
        (981, 1000, 1000, None),
        (1000, 1000, 1100, None),
        (1001, 1000, 1000, "lines: at most 1,000, got 1,001"),
        (979, 1000, 1000, "lines: 979 are 2 % below 1,000: lower the limit"),
        (1001, 1001, 1000, "lines: the limit rose from 1,000 to 1,001"),
    ],
)
def test_a_limit_holds_and_only_goes_down(count: int, limit: int, before: int, said: str | None):
    found = budgets.complaints({"lines": count}, {"lines": limit}, {"lines": before})
    assert len(found) == (said is not None)
    assert said is None or found[0].startswith(said)


def test_a_count_without_a_limit_is_none() -> None:
    assert budgets.complaints({"lines": 1}, {}, {}) == [
        "counts without a limit, or limits of nothing: lines"
    ]


def test_one_line_more_in_a_file_is_counted() -> None:
    path = SOURCE.parents[1] / "kmpc_lite" / "__init__.py"
    assert budgets.lines("kmpc_lite/__init__.py") == len(path.read_text().splitlines())
    assert budgets.tracked("kmpc_lite/__init__.py") == [path]
