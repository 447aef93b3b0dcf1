"""Folders in which kmpc is run."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_folder import SHORT

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.cli import main as cli


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log, a model, a run and a scenario; not to be written to."""
    folder = tmp_path_factory.mktemp("made")
    plant = kmpc_lab.DifferentialDrive(0.05, seed=1)
    data = kmpc_lab.generate_dataset(plant, episodes=16, steps=60, dt=0.1, seed=1, u_max=(0.6, 0.8))
    data.save(folder / "drive.csv")
    kl.Dataset(data.windows(4.0).episodes[:1]).save(folder / "brief.csv")
    kl.fit(data).save(folder / "robot.npz")
    (folder / "short.toml").write_text(SHORT)
    words = ["simulate", "--scenario", str(folder / "short.toml"), "--record", str(folder / "run")]
    assert cli.main(words) == 0
    return folder


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder."""
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def blank(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is drawn on the pictures of a report: where only its words are looked at."""
    monkeypatch.setattr("kmpc_lab.report.html.render", lambda figure, kind: b"<svg/>")
