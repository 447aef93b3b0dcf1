"""The CSV of a drive: what is in it, what is left out, and a torn row that is mended."""

import math

import numpy as np
import pytest
from recorder_rig import TICK, drive
from robots import Clock

import kmpc_lite as kl
from firmware_bridge.messages import State
from firmware_bridge.recording.recorder import CsvRecorder, RowSampler, Tick
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_table import Action, GateState


def test_the_csv_is_a_dataset_of_the_models_period(tmp_path):
    path = tmp_path / "drive.csv"
    recorder = CsvRecorder(path, 0.1)
    drive(recorder, command_every=0.37)
    recorder.close()
    data = kl.Dataset.load(path)
    assert (
        len(data) == 1
        and data.dt == pytest.approx(0.1, rel=1e-9)
        and recorder.rows == data.steps + 1
    )
    assert data.steps > 190
    errors = (
        kl.nominal_unicycle(0.1).predict(data.episodes[0].states[:-1], data.episodes[0].inputs)
        - data.episodes[0].states[1:]
    )
    # the robot obeys exactly, so all that is left is the interpolation between poses up to 0.04 s
    # apart, over jumps of up to 0.6 m/s
    assert np.abs(errors[:, :2]).max() < 0.6 * 0.04 / 4 and np.median(np.abs(errors[:, :2])) < 2e-5


@pytest.mark.parametrize("lost", [(5.0, 5.4), (5.0, 5.9), (5.0, 9.0)])
def test_a_gap_in_the_poses_ends_an_episode(tmp_path, lost):
    path = tmp_path / "drive.csv"
    recorder = CsvRecorder(path, 0.1)
    truth = drive(recorder, silent=[lost])
    recorder.close()
    data = kl.Dataset.load(path)
    assert len(data) == 2
    stamps = np.array([s.stamp for s in truth])
    for episode in data.episodes:
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        row = int(np.argmin(np.abs(table[:, 1:4] - episode.states[0]).sum(axis=1)))
        origin = 50.0 + TICK  # the first tick with a pose and a command, within a tick
        nearest = truth[int(np.argmin(np.abs(stamps - (origin + table[row, 0]))))]
        assert math.hypot(nearest.x - episode.states[0, 0], nearest.y - episode.states[0, 1]) < 0.03


def test_what_we_did_not_command_is_left_out(tmp_path):
    path = tmp_path / "drive.csv"
    recorder = CsvRecorder(path, 0.1)
    drive(
        recorder,
        states=lambda t: (
            GateState.YIELDED if 6.0 <= t < 6.1 or 12.0 < t < 15.0 else GateState.ACTIVE
        ),
    )
    recorder.close()
    data = kl.Dataset.load(path)
    assert len(data) == 3 and 15.0 < data.steps * 0.1 < 17.0


@pytest.mark.parametrize("pause", [(0.0, 0.0), (7.05, 7.33), (7.05, 10.91)])
def test_a_row_holds_one_plans_command(tmp_path, pause):
    path, clock = tmp_path / "drive.csv", Clock(50.0)
    recorder = CsvRecorder(path, 1.0)
    for k in range(1500):
        # plans begin every second, at 0.64 s past; the gate lets them pass from 0.2 s on, but for a
        # pause
        clock.now = 50.0 + k * TICK
        since = clock.now - 50.0
        plan, before = math.floor(since - 0.63), math.floor(since - TICK - 0.63)
        active = since >= 0.2 and not pause[0] <= since < pause[1]
        gate = GateState.ACTIVE if active else GateState.YIELDED
        output = GateOutput(0.01 * plan, 0.0, Action.SEND if active else Action.NOTHING, gate, ())
        recorder.on_tick(
            clock.now,
            State(0.0, 0.0, 0.0, 0.0, 0.0, clock.now),
            output,
            active,
            active and plan != before,
        )
    recorder.close()
    v = np.loadtxt(path, delimiter=",", skiprows=1)[:, 4] * 100.0
    assert len(v) > 20 and np.allclose(v, np.round(v), atol=1e-3)


def test_a_pose_that_is_not_finite_leaves_its_rows_out():
    sampler = RowSampler(0.1)
    rows = []
    for k in range(300):
        t = 10.0 + k * TICK
        x = math.nan if 150 <= k < 155 else 0.1 * t
        rows += sampler.take(
            Tick(t, State(x, 0.0, 0.0, 0.1, 0.0, t), (0.1, 0.0, 0.0), True, fresh=True)
        )
    rows += sampler.finish(t)
    assert np.isfinite(rows).all()
    steps = np.diff([r[0] for r in rows])
    assert (steps > 0.29).sum() == 1 and np.allclose(steps[steps < 0.29], 0.1)
