"""Runs as files: what is read is what was written, and nothing else is taken for a run."""

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


@pytest.mark.parametrize(
    "header",
    [
        {"outcome": "lost"},
        {"scenario": "[map]\nbounds = [0, 0, 0, 0]"},
        {"dt": "soon"},
        {"statuses": 4},
        {"name": None, "dt": None},
        "[1, 2]",
    ],
)
def test_headers_that_make_no_sense_are_refused(
    run: Run, tmp_path: Path, header: dict[str, object] | str
) -> None:
    run.save(tmp_path / "run.npz")
    rewrite(tmp_path / "run.npz", tmp_path / "other.npz", header)
    with pytest.raises(kl.ScenarioError, match=r"other\.npz"):
        Run.load(tmp_path / "other.npz")


def test_what_cannot_be_written_leaves_what_was_there(run: Run, tmp_path: Path) -> None:
    with pytest.raises(kl.ScenarioError, match="cannot write"):
        run.save(tmp_path / "no" / "folder" / "run.npz")
    (tmp_path / "folder").mkdir()
    with pytest.raises(kl.ScenarioError, match="cannot write"):
        run.save(tmp_path / "folder")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder"]
