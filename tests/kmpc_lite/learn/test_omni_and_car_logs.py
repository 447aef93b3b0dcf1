"""Logs of omnis and cars: what they are learned as, and how that drives."""

import re

import numpy as np
import pytest
from helpers import foreign_logs

import kmpc_lite as kl
from firmware_bridge.recording.drive.encoder import DriveEncoder
from firmware_bridge.recording.drive.schemas import PoseSeen, Sent
from kmpc_lab.sim.plants.steered import MecanumDrive, SteeredDrive
from kmpc_lite.learn.formats.rosbag import ACKERMANN_STAMPED
from kmpc_lite.learn.loading import load_logs
from kmpc_lite.learn.logs import ReadOptions
from kmpc_lite.learn.steering import disobeyed, find_wheelbase
from kmpc_lite.model.dictionary import ResponseDictionary
from kmpc_lite.scenario.files import Scenario

GAINS = np.array((1.1, 0.8, 0.9))


def omni_log(episodes=20, steps=100, noise=0.0, seed=0):
    random, plant = np.random.default_rng(seed), MecanumDrive(seed=seed)
    made = []
    for _ in range(episodes):
        pose, states, inputs = random.uniform(-1, 1, 3), [], []
        states.append(pose)
        for k in range(steps):
            if k % 5 == 0:
                command = random.uniform(-1, 1, 3) * (0.6, 0.6, 0.8)
            pose = plant.trace(pose, command * GAINS, 0.1, 1)[0]
            states.append(pose)
            inputs.append(command)
        spread = noise * np.array((0.005, 0.005, 0.02))
        seen = np.array(states) + spread * random.normal(size=(steps + 1, 3))
        made.append(kl.Episode(seen, np.array(inputs), 0.1))
    return kl.Dataset(made)


def test_an_omni_is_learned_from_its_log_to_the_last_gain():
    model = kl.fit(omni_log())
    assert model.inputs == 3
    moved = model.predict((0, 0, 0), np.eye(3)) / 0.1
    np.testing.assert_allclose(np.abs(moved).max(axis=1), GAINS, rtol=1e-3)


def car_rows(wheelbase=0.33, deadman=False):
    """Rows t, x, y, theta, v, steering angle of a car."""
    random, car = np.random.default_rng(1), SteeredDrive(kl.Car(0.5, steering_rate=8.0), 0.01)
    pose, rows = np.zeros(3), []
    for k in range(2400):
        if k % 15 == 0:
            v, angle = random.uniform(-0.5, 1.0), random.uniform(-0.5, 0.5)
        ignored = deadman and 1000 <= k < 1200
        rows.append((0.05 * k, *pose, 1.0 if ignored else v, angle))
        command = (0.0, 0.0) if ignored else (v, v * np.tan(angle) / wheelbase)
        pose = car.trace(pose, command, 0.05, 1)[0]
    return np.array(rows)


def test_a_car_behind_an_autopilot_turns_as_it_is_told_while_its_speed_lags(tmp_path):
    random, pose, driven, rows = np.random.default_rng(3), np.zeros(3), 0.0, []
    for k in range(1200):
        if k % 15 == 0:
            v, bend = random.uniform(-0.5, 1.0), random.uniform(-0.9, 0.9)
        rows.append((0.1 * k, *pose, v, bend))
        driven += 0.3 * (v - driven)
        middle = pose[2] + 0.05 * v * bend
        pose = pose + 0.1 * np.array((driven * np.cos(middle), driven * np.sin(middle), v * bend))
    data = load_logs([written(tmp_path, np.array(rows), "curvature")], 0.1)
    model = kl.fit(data, lags="auto")
    ours, theirs = (kl.evaluate(m, data, 1.0).multi_step for m in (model, kl.nominal_unicycle(0.1)))
    assert ours[2] <= 1.05 * theirs[2] and ours[0] < 0.5 * theirs[0]


def written(tmp_path, rows, name="steering_angle"):
    file = tmp_path / "car.csv"
    header = f"t,x,y,theta,v,{name}"
    np.savetxt(file, rows, delimiter=",", header=header, comments="", fmt="%.6f")
    return file


def test_a_wheelbase_is_found_from_how_the_poses_turn():
    rows = car_rows()
    found = find_wheelbase(rows[:, 0], rows[:, 1:4], rows[:, 5])
    assert found == pytest.approx(0.33, rel=0.25)
    with pytest.raises(kl.DataError, match="turns too little"):
        find_wheelbase(rows[:, 0], rows[:, 1:4] * 0.0, rows[:, 5])


@pytest.mark.parametrize("name", ["steering", "steering_angle", "delta"])
def test_steering_angles_become_turn_rates(tmp_path, name):
    rows = car_rows()
    told: list[str] = []
    how = ReadOptions(wheelbase=0.33)
    data = load_logs([written(tmp_path, rows, name)], 0.1, how=how, tell=told.append)
    every = np.concatenate([e.inputs for e in data.episodes])
    sharp = np.abs(every[:, 1]) / np.maximum(np.abs(every[:, 0]), 1e-3)
    assert np.quantile(sharp, 0.8) < np.tan(0.5) / 0.33
    assert any("a car; wheelbase 0.33 m" in line for line in told)
    model = kl.fit(data, lags="auto")
    turned = model.predict((0, 0, 0), (0.5, 0.5), np.tile((0.5, 0.5), (model.history, 1)))[2]
    assert turned == pytest.approx(0.05, rel=0.2)


CARS = [
    (5, 57.3, "--units steering=deg"),
    (3, 57.3, "--units theta=deg"),
    (2, -1.0, "or y has the other sign (--units y=-m)"),
    (4, 100.0, "--units v=cm/s"),
]


@pytest.mark.parametrize(("column", "times", "told"), CARS)
def test_what_is_wrong_with_a_cars_log_is_told(tmp_path, column, times, told):
    rows = car_rows() * np.where(np.arange(6) == column, times, 1.0)
    with pytest.raises(kl.DataError, match=re.escape(told)):
        load_logs([written(tmp_path, rows)], 0.1)


ASIDE = {5: "lateral > 0 drives to the right: --units lateral=-m/s", 2: "--units y=-m"}


@pytest.mark.parametrize("column", ASIDE)
def test_what_is_wrong_with_an_omnis_log_is_told(tmp_path, column):
    (drive,) = omni_log(1, 1200).episodes
    rows = np.column_stack([0.1 * np.arange(1200), drive.states[1:], drive.inputs])
    rows[:, column] *= -1.0
    with pytest.raises(kl.DataError, match=ASIDE[column]):
        load_logs([written(tmp_path, rows, "vy,omega")], 0.1)


def test_what_a_deadman_switch_holds_back_is_left_out_with_a_line(tmp_path):
    rows = car_rows(deadman=True)
    out = disobeyed(rows[:, 0], rows[:, 1:4], rows[:, 4])
    assert out[1020:1180].all() and out[:900].mean() < 0.02 and out[1300:].mean() < 0.02
    told: list[str] = []
    load_logs([written(tmp_path, rows)], 0.1, tell=told.append)
    assert any("nothing obeyed the commands" in line for line in told)


def test_a_robot_that_turns_where_it_stands_is_no_car(tmp_path):
    random, pose, rows = np.random.default_rng(0), np.zeros(3), []
    for k in range(1200):
        if k % 15 == 0:
            v, omega = random.uniform(-0.5, 1.0), random.uniform(-1.0, 1.0)
        rows.append((0.05 * k, *pose, v, random.uniform(-0.5, 0.5)))
        pose = pose + 0.05 * np.array((v * np.cos(pose[2]), v * np.sin(pose[2]), omega))
    with pytest.raises(kl.DataError, match="otherwise than it is steered"):
        load_logs([written(tmp_path, np.array(rows))], 0.1)


def write_omni(path, time, poses, sent):
    """A log of v, to the left and omega: a table, a bag, or a drive that kmpc recorded."""
    turned = sent[:, [0, 2, 1]]
    if path.suffix == ".csv":
        table = np.column_stack([time, poses, sent])
        np.savetxt(path, table, delimiter=",", header="t,x,y,theta,v,vy,omega", comments="")
    elif path.suffix == ".bag":
        foreign_logs.write_bag(path, foreign_logs.Drive(time, poses, time, turned), "ros1")
    else:
        encoder = DriveEncoder(Scenario.load("mehrez"), 0.1, {})
        seen = map(PoseSeen, time, poses.tolist())
        records = [*seen, *map(Sent, time, turned.tolist())]
        path.write_bytes(b"".join([encoder.begin(0.0), *encoder.encode(records)]))


@pytest.mark.parametrize("ending", [".csv", ".bag", ".mcap"])
def test_speeds_to_the_left_make_an_omni_if_they_say_anything(tmp_path, ending):
    log = omni_log(episodes=1, steps=300).episodes[0]
    for share, inputs in ((1.0, 3), (0.001, 2)):
        file, sent = tmp_path / f"{inputs}{ending}", log.inputs * (1.0, share, 1.0)
        write_omni(file, 1.0 + 0.1 * np.arange(len(log)), log.states[:-1], sent)
        data = load_logs([file], 0.1, how=ReadOptions(force=True))
        assert not data.steered
        kept = sent if inputs == 3 else sent[:, [0, 2]]
        np.testing.assert_allclose(data.episodes[0].inputs[:200], kept[:200], atol=1e-6)


def test_a_rolling_car_turns_as_its_wheels_are_steered():
    late = ResponseDictionary(
        kl.HermiteTrigDictionary(0), (0.5, 0.5), (0.3, 0.7), limits=(2.0, 2.0), steered=True
    )
    u, past = np.array((0.0, 0.0)), np.array([(1.0, 0.8)])
    np.testing.assert_allclose(late.inputs(u, past), (0.5, 0.4))
    np.testing.assert_array_equal(late.inputs(u, u[None]), (0.0, 0.0))
    u, slopes = np.array((0.9, -0.4)), late.inputs_jacobian(np.array((0.9, -0.4)), past)
    for column in range(2):
        step = 1e-6 * np.eye(2)[column]
        change = (late.inputs(u + step, past) - late.inputs(u - step, past)) / 2e-6
        np.testing.assert_allclose(slopes[:, 0, column], change, atol=0.03)


def test_a_bag_with_steering_angles_is_a_cars(tmp_path):
    pytest.importorskip("rosbags")
    t, poses, sent = np.split(car_rows(), [1, 4], axis=1)
    drive = foreign_logs.Drive(t[:, 0], poses, t[:, 0], sent)
    bag = foreign_logs.write_bag(tmp_path / "bag", drive, commands=ACKERMANN_STAMPED)
    told: list[str] = []
    data = load_logs([bag], 0.1, tell=told.append)
    assert data.steered and any("a car; wheelbase 0.3" in line for line in told), told


@pytest.mark.parametrize("ending", [".csv", ".npz"])
def test_saved_logs_of_cars_and_omnis_are_learned_to_the_same_model(tmp_path, ending):
    car = load_logs([written(tmp_path, car_rows())], 0.1)
    for name, log in (("car", car), ("omni", omni_log(episodes=4))):
        log.save(tmp_path / (name + ending))
        again = kl.Dataset.load(tmp_path / (name + ending))
        assert again.steered == log.steered and again.commands == log.commands
        ours, theirs = (kl.fit(d, noise=False) for d in (log, again))
        assert ours.dictionary.config() == theirs.dictionary.config()
        np.testing.assert_array_equal(ours.H, theirs.H)


def as_drive(rows, shares):
    """An ArduPilot's commands: speeds and turn rates, or shares of throttle and of its servo."""
    t, v, curvature = rows[:, 0], rows[:, 4], np.tan(rows[:, 5]) / 0.33
    told = 0.8 * curvature if shares else v * curvature
    return foreign_logs.Drive(t, rows[:, 1:4], t, np.column_stack([v, told]))


@pytest.mark.parametrize("shares", [False, True], ids=["wanted speeds", "outputs"])
@pytest.mark.parametrize("kind", ["bin", "tlog"])
def test_an_autopilot_whose_servo_steers_is_a_cars(tmp_path, kind, shares):
    drive, file = as_drive(car_rows(), shares), tmp_path / f"car.{kind}"
    if kind == "bin":
        foreign_logs.write_dataflash(file, drive, desired=not shares, car=True)
    else:
        pytest.importorskip("pymavlink")
        foreign_logs.write_tlog(file, drive, "sticks" if shares else "set_point", car=True)
    data = load_logs([file], 0.1)
    assert data.steered
    model = kl.fit(data, lags="auto")
    past = np.tile((0.5, 0.5), (model.history, 1))
    assert model.predict((0, 0, 0), (0.5, 0.5), past)[2] == pytest.approx(0.05, rel=0.2)
