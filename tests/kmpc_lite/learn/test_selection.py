"""What `lags="auto"` chooses: the robot that made the log, nothing if it shows nothing."""

from __future__ import annotations

import numpy as np
import pytest
from nominal_logs import nominal_log, open_loop_errors

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lab.sim.plants.steered import SteeredDrive
from kmpc_lite.geometry import exact_arc
from kmpc_lite.learn.lag import AT_ONCE
from kmpc_lite.learn.regression import symmetric_generator
from kmpc_lite.learn.selection import NOMINAL, select
from kmpc_lite.model.dictionary.response import TERMS, ResponseDictionary

TRIG = kl.HermiteTrigDictionary(0)


def late_log(lag: float, dead: float, noise: tuple[float, float, float], seed: int) -> kl.Dataset:
    """Two minutes of a robot that answers late and slips."""
    robot = LaggingDrive(lag, dead, 0.05, seed=seed)
    return drive_log(robot, 12, 100, 0.1, seed, hold=10, pose_noise=noise)


def test_a_turning_centre_beside_the_pose_is_found() -> None:
    random = np.random.default_rng(4)
    drives = []
    for episode in late_log(0.25, 0.1, (0.0, 0.0, 0.0), 4).episodes:
        poses = episode.states.copy()
        # the pose is tracked 8 cm to the left of what it turns about
        poses[:, 0] -= 0.08 * np.sin(poses[:, 2])
        poses[:, 1] += 0.08 * np.cos(poses[:, 2])
        poses += random.normal(size=poses.shape) * (0.004, 0.004, 0.01)
        drives.append(kl.Episode(poses, episode.inputs, episode.dt))
    found = select(kl.Dataset(drives))
    assert found.directions[0].step == "gains"
    assert found.rows.along[1] == pytest.approx(-0.08, abs=0.01)


@pytest.mark.parametrize("seed", range(2))
def test_a_nominal_robot_stays_nominal(seed: int) -> None:
    train, _ = nominal_log(90_000 + seed).windows(5.0).split(0.5)
    model = kl.fit(train, TRIG, lags="auto")
    nominal = kl.nominal_unicycle(0.1)
    x, u = np.random.default_rng(seed).normal(size=(2, 20, 3))
    np.testing.assert_allclose(model.predict(x, u[:, :2]), nominal.predict(x, u[:, :2]), atol=1e-9)


def test_turns_that_come_out_at_six_tenths_gain_in_heading_and_lose_nothing_along() -> None:
    random = np.random.default_rng(3)
    robot = kmpc_lab.DifferentialDrive(0.0, 0, turn_gain=0.6)
    clean = kmpc_lab.generate_dataset(robot, episodes=20, steps=100, dt=0.1, seed=3)
    noise = np.array([0.01, 0.01, 0.03])
    data = kl.Dataset(
        [
            kl.Episode(e.states + random.normal(size=e.states.shape) * noise, e.inputs, e.dt)
            for e in clean.episodes
        ]
    )
    train, held = data.split(0.5)
    model = kl.fit(train, TRIG, lags="auto")
    directions = model.info["selection"]["directions"]
    assert directions["heading"]["step"] == "gain" and directions["along"]["step"] == "nominal"
    errors = [
        np.sqrt(np.mean(np.concatenate(open_loop_errors(m, held.episodes)) ** 2, axis=0))
        for m in (model, kl.nominal_unicycle(0.1))
    ]
    assert errors[0][2] < 0.6 * errors[1][2] and (errors[0] <= 1.001 * errors[1]).all()


def test_slip_that_grows_with_the_turn_rate_is_found() -> None:
    random = np.random.default_rng(4)
    rows = np.zeros((3, len(TERMS)))
    rows[0, 0], rows[2, 1], rows[0, 4], rows[1, 2] = 1.0, 0.6, -0.15, -0.1
    late = ResponseDictionary(TRIG, terms=TERMS, smoothing=(0.05, 0.1), limits=(1.0, 2.0))
    zeros = np.zeros((3, 3)), np.zeros((3, len(TERMS)))
    truth = kl.KoopmanModel(late, 0.1, *zeros, symmetric_generator(late, *rows), np.eye(3), True)
    inputs = np.repeat(random.uniform(-1.0, 1.0, (20, 12, 2)) * [1.0, 2.0], 8, axis=1)
    states = truth.rollout(np.zeros((20, 3)), inputs)
    states = states + random.normal(size=states.shape) * [0.01, 0.01, 0.02]
    data = kl.Dataset([kl.Episode(x, u, 0.1) for x, u in zip(states, inputs, strict=True)])
    found = select(data)
    assert found.directions[0].step == "slip" and found.directions[1].step in ("product", "slip")
    assert found.rows.across[2] == pytest.approx(-0.1, abs=0.03)


def test_how_it_turns_while_it_drives_is_not_told_by_turns_on_the_spot() -> None:
    """Small turn rates move nothing: products of both speeds explain that, and no other drive."""
    random = np.random.default_rng(0)
    spot, ahead = random.choice((-0.7, 0.7), 30), random.uniform(-0.12, 0.12, 30)
    turns = np.repeat(np.stack([spot, ahead], axis=1).ravel(), 25)
    inputs = np.stack([np.repeat(np.tile((0.0, 0.6), 30), 25), turns], axis=1)
    driven = inputs * np.stack([np.ones(len(turns)), np.abs(turns) > 0.2], axis=1)
    states = kl.nominal_unicycle(0.1).rollout(np.zeros(3), driven)
    states = states + random.normal(size=states.shape) * 0.003
    found = select(kl.Dataset([kl.Episode(states, inputs, 0.1)]))
    assert not any(found.rows.heading[2:])


def test_a_log_too_short_for_a_choice_leaves_the_nominal_robot() -> None:
    log = late_log(0.25, 0.1, (0.0, 0.0, 0.0), 0)
    found = select(kl.Dataset(log.windows(2.5).episodes[:2]))
    assert {d.step for d in found.directions} == {NOMINAL}
    assert found.speed == found.turn == AT_ONCE


@pytest.mark.parametrize(
    "options",
    [
        {"symmetric": False},
        {"method": "edmdc", "dictionary": None},
        {"ridge": 0.1},
        {"dictionary": kl.InputHistoryDictionary(TRIG, (0, 1))},
    ],
)
def test_what_does_not_go_with_it_is_refused(options: dict[str, object]) -> None:
    data = late_log(0.0, 0.0, (0.0, 0.0, 0.0), 0)
    with pytest.raises(kl.DataError, match="lags='auto' goes with the symmetric integral fit"):
        kl.fit(data, **{"dictionary": TRIG, "lags": "auto", **options})  # type: ignore[arg-type]


BACK = 0.7  # share of a commanded speed that happens in reverse


def driven(move, steered=False, episodes=12, steps=100, slow=0.0) -> kl.Dataset:
    """Drives of a robot that moves as `move(pose, command)` says, measured with some noise."""
    random, made = np.random.default_rng(0), []
    for _ in range(episodes):
        states, inputs = [np.zeros(3)], []
        for k in range(steps):
            if k % 8 == 0:
                v = random.choice((-1, 1)) * random.uniform(slow, 0.8)
                command = np.array((v, v * random.uniform(-1.5, 1.5) if steered else 0.0))
                if not steered:
                    command[1] = random.uniform(-1.0, 1.0)
            states.append(move(states[-1], command))
            inputs.append(command)
        seen = np.array(states) + random.normal(size=(steps + 1, 3)) * (0.002, 0.002, 0.004)
        made.append(kl.Episode(seen, np.array(inputs), 0.1, steered))
    return kl.Dataset(made)


def test_a_robot_that_reverses_more_slowly_than_it_is_commanded_is_learned_so() -> None:
    log = driven(lambda pose, u: exact_arc(pose, u[0] * (BACK if u[0] < 0.0 else 1.0), u[1], 0.1))
    model = kl.fit(log, kl.HermiteTrigDictionary(0), lags="auto")
    assert model.info["selection"]["directions"]["along"]["step"] == "gears"
    for v, gain in ((0.6, 1.0), (-0.6, BACK)):
        past = np.tile((v, 0.0), (model.history, 1))
        assert model.predict((0, 0, 0), (v, 0.0), past)[0] == pytest.approx(
            0.1 * gain * v, rel=0.03
        )


def test_a_car_with_gears_a_servo_that_is_off_and_understeer_is_learned_so() -> None:
    car = SteeredDrive(kl.Car(0.4), understeer=0.4, offset=0.15, backward_gain=BACK)
    log = driven(lambda pose, u: car.trace(pose, u, 0.1, 1)[0], steered=True, slow=0.15)
    model = kl.fit(log, kl.HermiteTrigDictionary(0), lags="auto")
    for v in (0.7, -0.7, 0.3):
        for curvature in (1.2, 0.0, -1.2):
            u = np.array((v, v * curvature))
            car.reset()
            for _ in range(5):
                true = car.trace(np.zeros(3), u, 0.1, 1)[0]
            found = model.predict(np.zeros(3), u, np.tile(u, (model.history, 1)))
            np.testing.assert_allclose(found, true, atol=0.006)
    assert abs(model.predict(np.zeros(3), (0.7, 0.0), np.tile((0.7, 0.0), (model.history, 1)))[2])
