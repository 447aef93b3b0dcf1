"""The first drive with a model: half speed, compared with the nominal robot, remembered."""

import json
from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from firmware_bridge.integration.rehearsal import (
    Rehearsal,
    advice,
    at_half_speed,
    known_rehearsal,
    record_file,
)
from firmware_bridge.messages import ConfigError
from firmware_bridge.robot_file import load_robot
from firmware_bridge.safety.gate_settings import Limits
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from tests.helpers.simulated_robot import Simulated

FILE = "robot.npz"


@pytest.fixture(autouse=True)
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def robot(name="rover-7", **control):
    sections = {
        "robot": {"name": name},
        "link": {"driver": "roboclaw", "url": "pty:none"},
        "control": {"model": FILE, **control},
    }
    return load_robot(None, sections)


def learn(turns):
    log = drive_log(LaggingDrive(turn_gain=turns), 6, 100, 0.1, 1, hold=8)
    kl.fit(log, kl.HermiteTrigDictionary(0)).save(FILE)


def rehearse(model_turns, robot_turns, seconds=30.0, of=None):
    """Drive a robot whose turns come out at a share of the commands; give the rehearsal."""
    learn(model_turns)
    rehearsal = Rehearsal(of or robot(), kl.KoopmanModel.load(FILE))
    simulated = Simulated(Limits(), lag=0.0, dead_time=0.0, gains=(1.0, robot_turns))
    simulated.watch = rehearsal_watch = Beside(rehearsal)
    random = np.random.default_rng(0)
    held = {}

    def control(state):
        from firmware_bridge.messages import VelocityCommand

        rehearsal.saw()
        if rehearsal_watch.trouble:
            raise StopIteration
        k = int(state.stamp / 0.8)
        if k not in held:
            held[k] = random.uniform((-0.15, -0.4), (0.15, 0.4))
        return VelocityCommand(*held[k], state.stamp)

    try:
        simulated.drive(control, seconds)
    except StopIteration:
        pass
    return rehearsal


class Beside:
    """Hands the ticks on."""

    def __init__(self, rehearsal):
        self.rehearsal = rehearsal

    @property
    def trouble(self):
        return self.rehearsal.trouble

    def on_tick(self, *tick):
        self.rehearsal.on_tick(*tick)


def test_a_model_that_predicts_better_passes_and_the_next_run_needs_no_rehearsal():
    learn(0.6)
    assert advice(robot(), False)[1][0].startswith("robot.npz: not rehearsed yet")
    assert advice(robot(), True)[0]
    rehearsal = rehearse(0.6, 0.6)
    assert rehearsal.trouble == ""
    told = rehearsal.finish()
    assert told["verdict"] == "BETTER" and told["windows"] >= 10
    assert json.loads(record_file(FILE).read_text())["vehicle"]["name"] == "rover-7"
    assert [p.name for p in Path().glob(".*.part")] == []
    assert advice(robot(), False) == (False, ())
    again, notes = advice(robot(), True)
    assert not again and "rehearsed before, drives at full speed" in notes[0]


def test_a_model_that_predicts_worse_stops_the_robot_and_is_refused_from_then_on():
    rehearsal = rehearse(0.4, 1.0)
    assert "rehearsal: the model predicts worse than the nominal robot" in rehearsal.trouble
    assert rehearsal.finish()["verdict"] == "WORSE"
    with pytest.raises(ConfigError, match="failed its rehearsal.*--trust-model"):
        advice(robot(), False)
    assert advice(robot(), True)[0]
    trusted, notes = advice(robot(trust_model=True), False)
    assert not trusted and "used nevertheless" in notes[0]


def test_another_model_and_another_vehicle_are_not_rehearsed_by_that():
    rehearse(0.6, 0.6).finish()
    assert known_rehearsal(robot()) is not None and known_rehearsal(robot())[0]
    assert known_rehearsal(robot(name="rover-8")) is None
    learn(0.61)
    assert known_rehearsal(robot()) is None


def test_a_drive_that_is_too_short_is_reported_and_not_remembered():
    rehearsal = rehearse(0.6, 0.6, seconds=4.0)
    assert rehearsal.finish()["verdict"] == "SHORT" and not record_file(FILE).exists()


def test_it_drives_at_half_speed():
    limits = at_half_speed(robot()).gate.limits
    assert (limits.v_max, limits.v_reverse, limits.omega_max) == (0.15, 0.15, 0.4)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"model": 1}', "[" * 60_000, "x" * 70_000])
def test_a_record_that_is_damaged_is_refused_in_one_line(text):
    learn(0.6)
    record_file(FILE).write_text(text)
    with pytest.raises(ConfigError, match="robot.npz.rehearsal.json: ") as error:
        advice(robot(), True)
    assert "\n" not in str(error.value)
