"""A simulated drive as MCAP: read back as the same run, shown, and learned from."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from readers import without_checksums

import kmpc_lite as kl
from firmware_bridge.recording.drive.encoder import DriveEncoder
from firmware_bridge.recording.drive.schemas import Gate, PoseSeen, Sent
from kmpc_lab import Outcome, Run
from kmpc_lab.recording.drive_file import load_drive
from kmpc_lab.recording.simulated import SimulationRecorder
from kmpc_lite.cli import main as cli
from kmpc_lite.learn.formats.mcap import DRIVE
from kmpc_lite.scenario.files import Scenario


def test_a_recorded_drive_is_the_same_run(recorded: tuple[Run, SimulationRecorder], tmp_path: Path):
    run, recorder = recorded
    file = recorder.write(tmp_path / "new" / "folder", run)
    assert file == tmp_path / "new" / "folder" / DRIVE
    read = load_drive(file.parent)
    assert read.outcome is run.outcome is Outcome.REACHED
    assert (read.duration, read.dt, read.statuses) == (run.duration, run.dt, run.statuses)
    assert read.clearance == pytest.approx(run.clearance)
    for name in ("states", "path", "plans", "inputs", "step_times"):
        np.testing.assert_allclose(getattr(read, name), getattr(run, name), atol=1e-4)
    assert read.scenario.to_toml() == run.scenario.to_toml()
    details = read.details
    assert details is not None and len(details.times) == len(run.inputs)
    np.testing.assert_allclose(details.times, 0.1 * np.arange(len(run.inputs)), atol=1e-9)
    np.testing.assert_allclose(details.poses, run.states[:-1], atol=1e-4)
    assert (details.margins[:, :-1] > 0.0).all() and details.margins.max() < 0.5
    assert len(details.circles) == len(run.inputs), "one of them moves"
    assert details.paths[details.path_of[-1]][-1] == pytest.approx(run.scenario.goal[:2], abs=0.1)


def test_a_part_of_a_drive_is_shown(
    scenario: Scenario, content: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra plot")
    path = tmp_path / "drive.mcap"
    path.write_bytes(content)
    run = load_drive(path)
    assert run.details is not None
    part = run.details.between(0.45, 0.8)
    assert part.times.round(6).tolist() == [0.5, 0.6, 0.7, 0.8]
    assert len(part.statuses) == len(part.plans) == len(part.path_of) == 4
    words = ["report", str(path), "-o", str(tmp_path / "part.html")]
    assert cli.main([*words, "--from", "0.5", "--to", "0.8"]) == 0
    assert (tmp_path / "part.html").exists()
    capsys.readouterr()
    assert cli.main([*words, "--from", "90"]) == 2
    assert "no step from 90 s to inf s: the drive lasts from 0.00 s to" in capsys.readouterr().err


def test_only_what_the_robot_obeyed_is_learned_from(scenario: Scenario, tmp_path: Path) -> None:
    encoder = DriveEncoder(scenario, 0.1, {})
    records: list[Any] = []
    for k in range(100):
        time = 0.1 * k
        records.append(PoseSeen(time, (0.05 * k, 0.0, 0.0)))
        if k < 50:
            records.append(Sent(time, (0.5, 0.0, 0.0)))
    records += [Gate(0.0, "ACTIVE"), Gate(4.95, "YIELDED")]
    path = tmp_path / "drive.mcap"
    records.sort(key=lambda record: record.time)
    path.write_bytes(encoder.begin(0.0) + b"".join(encoder.encode(records)))
    from kmpc_lite.learn.formats.readers import read_log

    log = read_log(path)
    assert log.poses.time[-1] == pytest.approx(4.9) and "50 poses" in log.notes[-1]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b'"SOLVED"', b'"SOLVEX"'),
        (b'"progress":"DRIVING"', b'"progress":"DRIVINX"'),
        (b'"dt": 0.1', b'"dt": 0.0'),
        (b'"margins":[', b'"margins":{'),
        (b'{"x":1.0', b'{"x":1e9'),
        (b"kmpc.drive", b"kmpc.drivX"),
    ],
)
def test_what_is_no_drive_is_refused(content: bytes, old: bytes, new: bytes, tmp_path: Path):
    path, run = tmp_path / "drive.mcap", content.replace(old, new)
    path.write_bytes(without_checksums(run))  # so that what they hold is read
    assert run != content
    with pytest.raises(kl.ScenarioError, match="drive.mcap: .*damaged"):
        load_drive(path)


def test_a_drive_that_was_cut_off_is_read_up_to_there(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "torn.mcap"
    path.write_bytes(content[: 4 * len(content) // 5])
    run = load_drive(path)
    assert run.info["ended"] == "the recording breaks off" and run.outcome is Outcome.TIMEOUT
    assert run.details is not None and 5 < len(run.details.times) < 30
    assert run.clearance > 0.0
