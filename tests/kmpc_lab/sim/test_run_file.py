"""Runs as files: what is read is what was written, and nothing else is taken for a run."""

from __future__ import annotations

import json
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from scripted import Scripted, field

import kmpc_lite as kl
from kmpc_lab import Run, drive


@pytest.fixture(scope="module")
def run() -> Run:
    scenario = field(
        circles=(kl.Circle(0.5, 2.0, 0.1, 0.1, 0.0),),
        slip=0.05,
        seed=3,
        pose_noise=(0.01, 0.0, 0.0),
    )
    return drive(Scripted((0.5, 0.1)), scenario, info={"plant": "slip", "numbers": [1, 2.5, None]})


def rewrite(
    source: Path, target: Path, header: dict[str, object] | str | None = None, **arrays: object
) -> None:
    """Copy a run file with parts of it changed; None leaves an array out."""
    with np.load(source) as archive:
        parts: dict[str, object] = {name: archive[name] for name in archive.files}
    if isinstance(header, dict):
        parts["header"] = np.array(json.dumps({**json.loads(str(parts["header"])), **header}))
    elif header is not None:
        parts["header"] = np.array(header)
    parts.update(arrays)
    np.savez(target, **{k: v for k, v in parts.items() if v is not None})


def test_a_run_survives_being_written(run: Run, tmp_path: Path) -> None:
    run.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    for f in fields(Run):
        value, other = getattr(run, f.name), getattr(again, f.name)
        if f.name == "scenario":
            assert vars(value) == vars(other)
        elif isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, other)
        else:
            assert value == other, f.name
    assert again.summary() == run.summary()
    assert list(tmp_path.iterdir()) == [tmp_path / "run.npz"]  # no leftovers


def test_a_run_without_obstacles_too(tmp_path: Path) -> None:
    run = drive(Scripted((0.5, 0.0)), field())
    run.save(str(tmp_path / "run.npz"))
    assert Run.load(str(tmp_path / "run.npz")).clearance == np.inf


def test_the_name_is_taken_as_it_is(run: Run, tmp_path: Path) -> None:
    run.save(tmp_path / "run")
    assert [f.name for f in tmp_path.iterdir()] == ["run"]
    assert Run.load(tmp_path / "run").duration == run.duration


def test_files_cut_short_or_flipped_are_refused(run: Run, tmp_path: Path) -> None:
    run.save(tmp_path / "run.npz")
    content = (tmp_path / "run.npz").read_bytes()
    damaged = tmp_path / "damaged.npz"
    for cut in (0, 1, 30, len(content) // 2, len(content) - 1):
        damaged.write_bytes(content[:cut])
        with pytest.raises(kl.ScenarioError, match="damaged"):
            Run.load(damaged)
    random = np.random.default_rng(0)
    for _ in range(200):
        flipped = bytearray(content)
        for place in random.integers(0, len(content), 4):
            flipped[place] ^= 1 << int(random.integers(8))
        damaged.write_bytes(flipped)
        try:
            same = Run.load(damaged)  # some bits do not matter: dates, for example
        except kl.ScenarioError as error:
            assert "damaged.npz" in str(error) and "\n" not in str(error)
        else:
            np.testing.assert_array_equal(same.path, run.path)


def test_other_files_are_refused(run: Run, tmp_path: Path) -> None:
    run.save(tmp_path / "run.npz")
    kl.nominal_unicycle(0.1).save(tmp_path / "model.npz")
    np.save(tmp_path / "array.npy", np.zeros(3))
    np.savez(tmp_path / "empty.npz")
    (tmp_path / "text.npz").write_text("hello")
    for name in ("model.npz", "array.npy", "empty.npz", "text.npz"):
        with pytest.raises(kl.ScenarioError, match=name):
            Run.load(tmp_path / name)
    for missing in (tmp_path / "none.npz", tmp_path):
        with pytest.raises(kl.ScenarioError, match="cannot read"):
            Run.load(missing)


@pytest.mark.parametrize(
    "header",
    [
        {"version": 2},
        {"format": "other"},
        {"outcome": "lost"},
        {"scenario": "[map"},
        {"scenario": "[map]\nbounds = [0, 0, 0, 0]"},
        {"scenario": 3},
        {"dt": "soon"},
        {"statuses": 4},
        {"name": None, "dt": None},
        "not JSON",
        "[1, 2]",
        "3",
    ],
)
def test_headers_that_make_no_sense_are_refused(
    run: Run, tmp_path: Path, header: dict[str, object] | str
) -> None:
    run.save(tmp_path / "run.npz")
    rewrite(tmp_path / "run.npz", tmp_path / "other.npz", header)
    with pytest.raises(kl.ScenarioError, match=r"other\.npz"):
        Run.load(tmp_path / "other.npz")


@pytest.mark.parametrize("name", ["states", "path", "inputs", "plans", "step_times"])
@pytest.mark.parametrize("shape", [None, (), (0,), (3,), (2, 2), (1, 2, 4)])
def test_missing_arrays_and_those_of_other_shapes_are_refused(
    run: Run, tmp_path: Path, name: str, shape: tuple[int, ...] | None
) -> None:
    run.save(tmp_path / "run.npz")
    array = None if shape is None else np.zeros(shape)
    rewrite(tmp_path / "run.npz", tmp_path / "other.npz", **{name: array})
    with pytest.raises(kl.ScenarioError, match=f"other.npz.*{name}"):
        Run.load(tmp_path / "other.npz")


def test_pickles_are_never_read(run: Run, tmp_path: Path) -> None:
    run.save(tmp_path / "run.npz")
    rewrite(tmp_path / "run.npz", tmp_path / "other.npz", states=np.array([{"a": 1}], dtype=object))
    with pytest.raises(kl.ScenarioError):
        Run.load(tmp_path / "other.npz")


def test_what_cannot_be_written_leaves_what_was_there(run: Run, tmp_path: Path) -> None:
    with pytest.raises(kl.ScenarioError, match="cannot write"):
        run.save(tmp_path / "no" / "folder" / "run.npz")
    (tmp_path / "folder").mkdir()
    with pytest.raises(kl.ScenarioError, match="cannot write"):
        run.save(tmp_path / "folder")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder"]
