"""The study over random maps.

Complete, resumable, honest about failures, and its numbers those of the drives.
"""

from __future__ import annotations

import json
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from executors import Inline
from guided import GuideInUse
from scripted import Scripted

import kmpc_lite as kl
from kmpc_lite.errors import DataError
from kmpc_lite.learn.regression import Method
from kmpc_lite.sim import Scenario, drive
from kmpc_lite.sim.closed_loop import Run, Steps
from kmpc_lite.sim.maps.families import random_map
from kmpc_lite.studies.catalogue import STUDIES, choose
from kmpc_lite.studies.conditions import (
    BOTH_CHANGE,
    LAGGING,
    NOISY_LAGGING,
    OLD_LAGGING,
    PLAIN,
    Condition,
)
from kmpc_lite.studies.contenders import STUDY_CONTENDERS, Contender
from kmpc_lite.studies.failures import check_folder, failed, write_failures
from kmpc_lite.studies.random_maps import (
    SETTLE,
    drive_maps,
    maps_study,
    measure,
)
from kmpc_lite.studies.tables import format_maps, summarise, time_ratio, wilson

SMALL = {"episodes": 6, "steps": 30}


class Follower:
    """Drives to where the guide's reference will be in 0.3 s; no model."""

    def __init__(self, problem: kl.NavigationProblem) -> None:
        self.guide, self.problem = GuideInUse(problem), problem

    def step(self, x: Any, goal: Any, obstacles: Any = ()) -> kl.Plan:
        pose = np.array(x, dtype=float)
        pose[2] -= 2 * np.pi * np.round(pose[2] / (2 * np.pi))
        target = self.guide.reference(pose, np.asarray(goal), obstacles).states[2]
        error = target - pose
        ahead = np.cos(pose[2]) * error[0] + np.sin(pose[2]) * error[1]
        aside = np.cos(pose[2]) * error[1] - np.sin(pose[2]) * error[0]
        u_min, u_max, _, _ = self.problem.bounds
        command = np.clip(
            [ahead / 0.3, (error[2] + 2 * np.sign(ahead) * aside) / 0.3], u_min, u_max
        )
        return kl.Plan(
            command,
            np.tile(pose, (4, 1)),
            np.tile(command, (3, 1)),
            kl.PlanStatus.SOLVED,
            1,
            {"total": 2e-3},
        )


@dataclass(frozen=True)
class Spec:
    """A controller without a model; can be sent to another process."""

    label: str
    kind: str
    fit: Method | None = None

    def build(self, model: kl.KoopmanModel, scenario: Scenario) -> Steps:
        if self.kind == "follow":
            return Follower(replace(scenario.problem(), margin=0.04))
        return Scripted((0.0, 0.0) if self.kind == "stand" else (0.6, 0.0))


FOLLOW, STAND, RAM = Spec("follow", "follow"), Spec("stand", "stand"), Spec("ram", "ram")


def study(executor: Executor | None = None, **options: Any) -> list[dict[str, Any]]:
    values: dict[str, Any] = {
        "specs": [FOLLOW, STAND, RAM],
        "slips": (0.0, 0.1),
        "maps": 4,
        "first_seed": 100,
        "training": SMALL,
    }
    values.update(options)
    return maps_study(values.pop("specs"), executor or Inline(), **values)


@pytest.fixture(scope="module")
def records() -> list[dict[str, Any]]:
    return study()


def test_every_controller_drives_every_map_at_every_slip(records: list[dict[str, Any]]) -> None:
    seen = [(r["controller"], r["family"], r["slip"], r["seed"]) for r in records]
    assert seen == [
        (c, "open", s, 100 + i)
        for c in ("follow", "stand", "ram")
        for s in (0.0, 0.1)
        for i in range(4)
    ]


def test_a_record_says_what_the_drive_was(records: list[dict[str, Any]]) -> None:
    for record in records:
        if record["controller"] == "stand":
            assert failed(record) and record["collision_s"] is None and record["settled_s"] is None
    scenario = random_map("open", 101, 0.1)
    run = drive(FOLLOW.build(kl.nominal_unicycle(0.1), scenario), scenario, settle=SETTLE)
    record = next(
        r for r in records if (r["controller"], r["slip"], r["seed"]) == ("follow", 0.1, 101)
    )
    fresh = measure(run, "open", "follow", None)
    assert {k: v for k, v in record.items() if "step" not in k} == {
        k: v for k, v in fresh.items() if "step" not in k
    }
    assert (
        record["clearance_m"] == run.clearance and record["position_error_m"] == run.position_error
    )
    assert record["position_s"] <= record["pose_s"] <= record["settled_s"] - SETTLE + 0.11


def test_outcomes_are_told_apart(records: list[dict[str, Any]]) -> None:
    follow = [r for r in records if r["controller"] == "follow" and r["slip"] == 0.0]
    assert sum(not failed(r) for r in follow) == 4
    assert all(failed(r) for r in records if r["controller"] in ("stand", "ram"))
    assert any(r["collision_s"] is not None for r in records if r["controller"] == "ram")


def test_an_interrupted_study_goes_on_where_it_ended(
    tmp_path: Path, records: list[dict[str, Any]]
) -> None:
    path = tmp_path / "drives.jsonl"
    with pytest.raises(RuntimeError, match="worker died"):
        study(Inline(stop_after=3), records=path)
    kept = [json.loads(line) for line in path.read_text().splitlines()]
    # all that was driven is there
    assert len(kept) == 3 * 4 < len(records)
    # the process was killed while it wrote
    path.write_text(path.read_text() + '{"controller": "fol')
    progress: list[tuple[int, int]] = []
    executor = Inline()
    again = study(
        executor, records=path, progress=lambda done, total: progress.append((done, total))
    )
    untimed = [{k: v for k, v in r.items() if "step" not in k} for r in again]
    assert untimed == [{k: v for k, v in r.items() if "step" not in k} for r in records]
    assert progress[0] == (len(kept), 24) and progress[-1] == (24, 24)
    assert sum(len(args[-1]) for name, args in executor.asked if name == "drive_maps") == 24 - len(
        kept
    )
    assert len(path.read_text().splitlines()) == 24
    idle = Inline()
    assert study(idle, records=path) == again and not idle.asked


def test_more_maps_are_added_to_those_that_are_there(tmp_path: Path) -> None:
    path = tmp_path / "drives.jsonl"
    first = study(specs=[STAND], slips=(0.0,), maps=2, records=path)
    executor = Inline()
    more = study(executor, specs=[STAND], slips=(0.0,), maps=5, records=path)
    assert more[:2] == first and len(more) == 5
    assert [args[-1] for _, args in executor.asked] == [[102, 103, 104]]


@pytest.mark.parametrize("line", ["not json", "[1, 2]", '{"controller": "a"}'])
def test_a_foreign_file_is_refused_with_its_line(tmp_path: Path, line: str) -> None:
    path = tmp_path / "drives.jsonl"
    path.write_text(line + "\n")
    with pytest.raises(DataError, match="drives.jsonl: line 1: expected a drive of a maps study"):
        study(records=path)


def test_models_are_learned_once_for_each_slip_and_only_where_needed() -> None:
    learning = [
        Spec("a", "stand", fit="integral"),
        Spec("b", "stand", fit="integral"),
        Spec("c", "stand", fit="edmdc"),
    ]
    executor = Inline()
    found = study(executor, specs=learning, maps=1, slips=(0.0, 0.05))
    assert executor.names.count("learn") == 4  # two slips, two methods
    assert {(r["slip"], r["trained_at"]) for r in found} == {(0.0, 0.0), (0.05, 0.05)}
    elsewhere = Inline()
    mismatched = study(elsewhere, specs=learning[:1], maps=1, slips=(0.1, 0.2), trained_at=0.05)
    assert elsewhere.names.count("learn") == 1
    assert {r["trained_at"] for r in mismatched} == {0.05}


def test_a_drive_with_another_training_is_another_drive(tmp_path: Path) -> None:
    path, spec = tmp_path / "drives.jsonl", [Spec("a", "stand", fit="integral")]
    study(specs=spec, maps=1, slips=(0.1,), records=path)
    executor = Inline()
    study(executor, specs=spec, maps=1, slips=(0.1,), records=path, trained_at=0.0)
    assert [name for name, _ in executor.asked] == ["learn", "drive_maps"]
    assert len(path.read_text().splitlines()) == 2


def test_a_failure_is_a_scenario_file_that_replays_it(tmp_path: Path) -> None:
    found = study(specs=[RAM], slips=(0.0,), maps=5, failures=tmp_path / "failed")
    collided = [r for r in found if r["collision_s"] is not None]
    assert collided
    files = sorted((tmp_path / "failed").glob("*.toml"))
    assert len(files) == sum(failed(r) for r in found)
    for record in collided:
        (path,) = (f for f in files if f.name.startswith(f"open-{record['seed']}-slip0-ram"))
        scenario = Scenario.load(path)
        assert "# ram: collision; kmpc simulate" in path.read_text()
        again = drive(Scripted((0.6, 0.0)), scenario)
        assert again.outcome.value == "collision" and again.duration == record["collision_s"]


def test_no_failures_no_folder(tmp_path: Path) -> None:
    study(specs=[STAND], slips=(0.0,), maps=1, failures=tmp_path / "some")
    assert (tmp_path / "some").exists()
    seed = next(r["seed"] for r in study(specs=[FOLLOW], slips=(0.0,)) if not failed(r))
    study(specs=[FOLLOW], slips=(0.0,), maps=1, first_seed=seed, failures=tmp_path / "none")
    assert not (tmp_path / "none").exists()
    assert write_failures([], tmp_path / "none") == []


def test_where_failures_or_records_cannot_be_written_nothing_is_driven(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    executor = Inline()
    for folder in (tmp_path / "file", tmp_path / "file" / "below" / "it"):
        with pytest.raises(NotADirectoryError, match="file"):
            study(executor, failures=folder)
    with pytest.raises(OSError, match="none"):
        study(executor, records=tmp_path / "none" / "drives.jsonl")
    with pytest.raises(IsADirectoryError):
        study(executor, records=tmp_path)
    assert not executor.asked
    check_folder(tmp_path / "a" / "new" / "one")
    assert not (tmp_path / "a").exists()


def test_a_failure_of_a_learned_model_leaves_the_model_too(tmp_path: Path) -> None:
    spec = Spec("a", "stand", fit="integral")
    options: dict[str, Any] = {
        "specs": [spec],
        "slips": (0.1,),
        "maps": 2,
        "records": tmp_path / "drives.jsonl",
    }
    study(**options)
    # also of drives that were done before
    study(**options, failures=tmp_path / "failed")
    (model,) = (tmp_path / "failed").glob("*.npz")
    found = sorted((tmp_path / "failed").glob("*.toml"))
    assert len(found) == 2
    for path in found:
        first = path.read_text().splitlines()[0]
        assert first == f"# a: not there; kmpc simulate --scenario {path.name} --model {model.name}"
    assert kl.KoopmanModel.load(model).info["method"] == "integral"


def test_a_failure_is_driven_again_by_the_command_in_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from kmpc_lite.cli.main import main

    spec = Contender("ours, no adaptation", fit=None, adaptation=False)
    late = Condition("late", lag=1.5, dead_time=1.0, pose_age=0.2)
    # a model that knows no lag drives a robot that lags: it hits things
    found = study(
        specs=[spec], slips=(0.0,), maps=1, first_seed=3, conditions=(late,), failures=tmp_path
    )
    record = next(r for r in found if r["collision_s"] is not None)
    (file,) = tmp_path.glob(f"open-{record['seed']}-*.toml")
    words = file.read_text().splitlines()[0].partition("; kmpc ")[2].split()
    monkeypatch.chdir(tmp_path)
    assert main([*words, "-o", "run.npz"]) == 1
    run = Run.load("run.npz")
    assert run.outcome.value == "collision" and run.duration == record["collision_s"]


# -- conditions


def test_conditions_are_driven_and_told_apart(tmp_path: Path) -> None:
    late, path = (
        Condition("late", lag=0.2, dead_time=0.1, pose_noise=(0.01, 0.01, 0.0), pose_age=0.1),
        tmp_path / "drives.jsonl",
    )
    found = study(specs=[RAM, STAND], slips=(0.1,), maps=2, conditions=(PLAIN, late), records=path)
    assert [(r["controller"], r["condition"], r["seed"]) for r in found] == [
        (c, name, seed) for c in ("ram", "stand") for name in ("", "late") for seed in (100, 101)
    ]
    assert (
        study(
            Inline(stop_after=0),
            specs=[RAM, STAND],
            slips=(0.1,),
            maps=2,
            conditions=(PLAIN, late),
            records=path,
        )
        == found
    )
    scenario = late.apply(random_map("open", 100, 0.1))
    assert (scenario.lag, scenario.dead_time, scenario.pose_noise, scenario.pose_age) == (
        0.2,
        0.1,
        (0.01, 0.01, 0.0),
        0.1,
    )
    assert scenario.name == "open-100-late" and PLAIN.apply(scenario) is scenario
    rows = summarise(found)
    assert [(r.controller, r.condition, r.drives) for r in rows] == [
        (c, n, 2) for c in ("ram", "stand") for n in ("", "late")
    ]
    assert (
        "late" in format_maps(rows).splitlines()[2]
        and "condition" in format_maps(rows).splitlines()[0]
    )
    assert "condition" not in format_maps(rows[:1])


def test_a_lagging_robot_is_learned_from_its_own_log_once() -> None:
    executor, spec = Inline(), Spec("a", "stand", fit="integral")
    conditions = (NOISY_LAGGING, OLD_LAGGING)
    study(
        executor,
        specs=[spec],
        slips=(0.0,),
        maps=1,
        conditions=conditions,
        training={"episodes": 40, "steps": 60},
    )
    assert [name for name, _ in executor.asked] == ["learn", "drive_maps", "drive_maps"]
    model = next(args[1] for name, args in executor.asked if name == "drive_maps")
    assert model.history == 8 and model.info["noise_quantiles"]["windows"] > 50
    # what stands in the first 0.15 s is dead time
    now, later = model.H.reshape(3, -1, model.dictionary.size)[0, (0, 6), 1]
    assert abs(now) < 0.02 < 0.05 < later


def test_a_model_is_judged_on_the_floor_that_the_robot_came_to() -> None:
    learning = kl.fit(kl.generate_dataset(kl.DifferentialDrive(), episodes=20, steps=50))
    specs = [
        Contender("off", adaptation=False),
        Contender("on", adaptation=True),
    ]
    # a single short drive may teach little
    seeds = [3, 4, 5]
    off, on = (drive_maps(s, learning, 0.0, BOTH_CHANGE, "open", 0.0, seeds) for s in specs)
    with_it, without = (np.median([r["error_ratio"] for r in drives]) for drives in (on, off))
    assert with_it < 0.5 * without
    rows = summarise([*off, *on])
    assert rows[0].error_ratio is not None and rows[1].error_ratio is not None
    assert "to a fresh fit's" in format_maps(rows)
    # nothing is told of a controller without a model, or where the floor did not change
    assert drive_maps(STAND, learning, 0.0, BOTH_CHANGE, "open", 0.0, [3])[0]["error_ratio"] is None
    assert "error_ratio" not in drive_maps(STAND, learning, 0.0, LAGGING, "open", 0.0, [3])[0]


def test_other_processes_do_the_same(records: list[dict[str, Any]]) -> None:
    seeds, model = [100, 101], kl.nominal_unicycle(0.1)
    with ProcessPoolExecutor(1) as pool:
        there = pool.submit(drive_maps, FOLLOW, model, None, PLAIN, "open", 0.1, seeds).result()
    here = [
        r
        for r in records
        if r["controller"] == "follow" and r["slip"] == 0.1 and r["seed"] in seeds
    ]
    assert [{k: v for k, v in r.items() if "step" not in k} for r in there] == [
        {k: v for k, v in r.items() if "step" not in k} for r in here
    ]


# -- tables


def made_up(
    controller: str,
    slip: float,
    seed: int,
    collision: float | None,
    position: float | None,
    pose: float | None,
) -> dict[str, Any]:
    keys = (
        "controller",
        "family",
        "trained_at",
        "slip",
        "seed",
        "collision_s",
        "position_s",
        "pose_s",
    )
    record = dict(
        zip(keys, (controller, "open", None, slip, seed, collision, position, pose), strict=True)
    )
    return {**record, "condition": "", "clearance_m": -0.01 if collision else 0.02 + 0.001 * seed}


MADE_UP = [
    made_up("a", 0.0, 1, None, 5.0, 6.0),
    made_up("a", 0.0, 2, None, 7.0, None),
    made_up("a", 0.1, 1, 2.0, 1.0, 1.5),
    made_up("a", 0.1, 2, None, 4.0, 8.0),
    made_up("b", 0.0, 1, None, 4.0, 4.0),
    made_up("b", 0.0, 2, None, 4.0, 4.0),
    made_up("b", 0.1, 1, None, 4.0, 4.0),
    made_up("b", 0.1, 2, None, None, None),
]


def test_rows_count_what_arrived_untouched() -> None:
    rows = {(r.controller, r.slip): r for r in summarise(MADE_UP)}
    assert set(rows) == {(c, s) for c in "ab" for s in (0.0, 0.1, None)}
    still, slips, both = rows["a", 0.0], rows["a", 0.1], rows["a", None]
    assert (still.drives, still.collisions, still.at_position, still.at_pose) == (2, 0, 2, 1)
    assert (slips.drives, slips.collisions, slips.at_position, slips.at_pose) == (2, 1, 1, 1)
    assert (both.drives, both.collisions, both.at_position, both.at_pose) == (4, 1, 3, 2)
    assert both.position_s == pytest.approx(16 / 3) and both.pose_s == pytest.approx(7.0)
    assert slips.clearance_m == -0.01
    assert both.as_dict()["wilson_95"]["collisions"] == [round(v, 5) for v in wilson(1, 4)]
    json.dumps(both.as_dict())


def test_times_are_compared_where_both_arrive() -> None:
    # only seed 1 at slip 0: elsewhere one of them collides or never arrives
    assert time_ratio(MADE_UP, "a", "b") == (1, pytest.approx(1.5))
    assert time_ratio(MADE_UP, "a", "b", key="position_s") == (2, pytest.approx(12 / 8))
    assert time_ratio(MADE_UP, "a", "nobody") == (0, None)


def test_the_table_shows_each_row_once() -> None:
    lines = format_maps(summarise(MADE_UP)).splitlines()
    assert len(lines) == 1 + 6
    assert "collisions" in lines[0] and lines[3].split()[:4] == ["a", "open", "all", "4"]
    assert "75.0 %" in lines[3] and "-10 mm" in lines[3]


@pytest.mark.parametrize(
    ("successes", "trials"), [(0, 10), (1, 10), (5, 10), (10, 10), (0, 1), (799, 800), (800, 800)]
)
def test_wilson_holds_the_shares_whose_score_test_is_not_refused(
    successes: int, trials: int
) -> None:
    low, high = wilson(successes, trials)
    assert 0.0 <= low <= successes / trials <= high <= 1.0
    for end in (low, high):
        if 0.0 < end < 1.0:
            # at the ends the observed share is 1.96 standard errors away
            assert abs(successes / trials - end) == pytest.approx(
                1.959964 * np.sqrt(end * (1 - end) / trials), rel=1e-5
            )


def test_wilson_without_trials_knows_nothing() -> None:
    assert wilson(0, 0) == (0.0, 1.0)


# -- the studies by name


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_has_its_controllers(name: str) -> None:
    chosen = choose(STUDIES[name], None)
    assert [c.label for c in chosen][-1] in ("ours, everything on", "ours, no adaptation")
    assert {c.label for c in chosen} == set(STUDIES[name].controllers)
    names = [c.name for c in STUDIES[name].conditions]
    assert len(set(names)) == len(names)


def test_controllers_are_chosen_by_words() -> None:
    assert choose(STUDIES["maps"], ["paper", "no adapt"]) == [
        c for c in STUDY_CONTENDERS if "paper" in c.label or "no adapt" in c.label
    ]
    with pytest.raises(kl.ProblemError, match=r"nobody is left; labels are NMPC, IPOPT; "):
        choose(STUDIES["maps"], ["nobody"])
    with pytest.raises(kl.ProblemError, match="integral"):
        choose(STUDIES["lag"], ["everything on", "K-NMPC"])
