"""The experiments on the twin from data to table, on tuning seeds: what they promise."""

import json

import pytest

from kmpc_lab.experiments.__main__ import main

pytestmark = pytest.mark.long


def rows(capsys, *arguments):
    assert main([*map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out.splitlines()[-1])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("twin")


def test_the_learned_model_is_off_by_a_fifth_of_the_nominal_one_at_most(folder, capsys):
    fast = next(row for row in rows(capsys, "model", "--folder", folder) if row["model"] == "fast")
    assert fast["model_error"][2] <= fast["nominal_error"][2] / 5.0


@pytest.mark.parametrize(("which", "error"), [("a", 0.01), ("b", 0.03), ("c", 0.1)])
def test_every_goal_is_reached_without_a_touch(folder, capsys, which, error):
    drives = rows(capsys, which, "--folder", folder, "--tuning", "--trials", "1", "--only", "ours")
    assert [d for d in drives if d["outcome"] != "reached" or d["touched"]] == []
    assert sum(d["final_error_m"] for d in drives) / len(drives) <= error


def test_on_a_new_floor_adaptation_is_as_good_as_having_learned_it(folder, capsys):
    drives = rows(capsys, "d", "--folder", folder, "--tuning", "--trials", "1")
    assert all(d["outcome"] == "reached" for d in drives)

    def seconds(label, scenario):
        return next(
            d["arrival_s"] for d in drives if d["controller"] == label and d["scenario"] == scenario
        )

    for floor in ("carpet", "wet"):
        assert seconds("ours", f"twin_{floor}") <= 1.1 * seconds(
            f"ours, learned on {floor}", f"twin_{floor}"
        )
