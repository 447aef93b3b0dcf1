"""Gains that differ forward and backward, wheels that are not straight, tyres that understeer."""

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.plants.steered import SteeredDrive
from kmpc_lite.geometry import exact_arc

BACK = 0.7
"""Share of a commanded speed that happens in reverse."""


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
