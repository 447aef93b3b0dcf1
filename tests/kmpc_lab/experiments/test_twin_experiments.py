"""The experiments' clockwork.

The same bytes as the driver's, data that learn, drives that end as they should.
"""

import json
import os
from dataclasses import replace

import numpy as np
import pytest
from boards import Rig
from waiting import until

import kmpc_lite as kl
from kmpc_lab import Outcome
from kmpc_lab.emulator.mocap import Mocap, MocapOptions
from kmpc_lab.emulator.roboclaw import RoboClawEmulator
from kmpc_lab.experiments.__main__ import main
from kmpc_lab.experiments.batch import BOARD, GEOMETRY
from kmpc_lab.experiments.collect import FAST, collect
from kmpc_lab.experiments.report import picture, table
from kmpc_lab.experiments.study import learn
from kmpc_lab.experiments.trials import Contender, drive_trial
from kmpc_lab.experiments.wire import ManualClock, Network, WiredRoboClaw
from kmpc_lite.scenario.files import Scenario


def wired(network=None, **mocap):
    clock = ManualClock()
    board = RoboClawEmulator(GEOMETRY, BOARD, clock=clock)
    return (
        clock,
        board,
        WiredRoboClaw(
            board, BOARD, Mocap(MocapOptions(**mocap), 0, clock()), clock, network or Network(), 0
        ),
    )


def test_a_command_is_the_same_frame_as_the_drivers_own(tmp_path):
    table = {
        "geometry": {
            "wheel_radius": GEOMETRY.wheel_radius,
            "track": GEOMETRY.track,
            "max_wheel_speed": GEOMETRY.max_wheel_speed,
        }
    }
    rig = Rig(
        "roboclaw",
        f"pty:{tmp_path}/link",
        {**table, "board": {"counts_per_turn": BOARD.counts_per_turn, "watchdog": BOARD.watchdog}},
    )
    clock, _, driver = wired()
    driver.frames = []
    try:
        rig.connect()
        driver.connect(1.0)
        for v, omega in ((0.31, -0.4), (-0.2, 0.77)):
            rig.driver.send(v, omega)
            driver.send(v, omega)
            ours = driver.frames[-1]
            assert until(lambda ours=ours: ours in rig.wire.frames)
    finally:
        rig.close()
    # set-up and questions too: nothing goes out here that the driver would not say
    assert set(driver.frames) <= set(rig.wire.frames)


def test_a_network_delays_commands_and_keeps_their_order():
    clock, board, driver = wired(Network(0.2, 0.5, 1.0))
    driver.connect(1.0)
    heard = {}
    for k in range(300):
        clock.now = 1000.0 + 0.02 * k
        if k % 50 == 0:
            driver.send(0.1 + 0.001 * k, 0.0)
        driver.work()
        speed = board.wheel_command[0] * GEOMETRY.wheel_radius
        heard.setdefault(round(speed, 3), 0.02 * k)
    delays = [heard[round(0.1 + 0.05 * i, 3)] - i for i in range(5)]
    assert min(delays) > 0.19 and max(delays) < 0.53 and len({round(d, 2) for d in delays}) > 2


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A small set of data, and what is learned from it."""
    folder = tmp_path_factory.mktemp("twin")
    collect(folder / "fast", "fast", 400, seed=3)
    learn(folder, "fast", lambda name: lambda done, total: None)
    return folder


def test_data_go_through_the_recorder_and_teach_how_little_a_skid_steer_robot_turns(folder):
    held = json.loads((folder / "fast.json").read_text())["held_out"]
    assert held["multi_step"][2] < held["nominal_multi_step"][2] / 4.0
    log = kl.Dataset.load(sorted((folder / "fast").glob("*.csv"))[0])
    assert log.dt == pytest.approx(0.1) and len(log) == 1


def test_a_trial_reaches_its_goal_untouched_twice_the_same(folder):
    ours = Contender("ours", "kmpc", kl.KoopmanModel.load(folder / "fast.npz"), (0.6, 0.785))
    scenario = Scenario.load("twin_a2")
    first = drive_trial(ours, scenario, FAST, 7)
    again = drive_trial(ours, replace(scenario, timeout=2.0), FAST, 7).run.path
    assert first.run.outcome is Outcome.REACHED and not first.touched and first.run.clearance > 0.0
    assert first.final_error < 0.02
    assert len(again) > 20
    assert np.abs(first.run.path[: len(again)] - again).max() < 1e-9
    assert (len(first.run.path) - 1) % (len(first.run.states) - 1) == 0
    assert "| ours | a2 | 1 | 0 | 1 |" in table("a", [first])
    picture(folder / "a.png", [first])
    assert os.path.getsize(folder / "a.png") > 5000


def test_the_command_reports_the_speed_of_the_twin(tmp_path, capsys):
    assert main(["speed", "--folder", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["real_time_factor"] > 1.0


class Blind(Contender):
    def build(self, scenario):
        return Straight()


class Straight:
    """Drives north-east, whatever is there."""

    def step(self, x, goal, obstacles):
        plan = kl.Controller(kl.nominal_unicycle(0.1)).step((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
        turn = 0.7 if x[2] < 0.75 else 0.0
        plan.command[:] = (0.0 if turn else 0.4, turn)
        return plan


def test_a_controller_that_drives_into_an_obstacle_is_seen_to():
    blind = Blind("blind", "kmpc", kl.nominal_unicycle(0.1), (0.6, 0.785))
    trial = drive_trial(blind, Scenario.load("twin_a1"), FAST, 1)
    assert (
        trial.run.outcome is Outcome.COLLISION
        and trial.run.clearance < 0.0
        and "| blind | a1 | 1 | 1 | 0 | - | - |" in table("a", [trial])
    )
