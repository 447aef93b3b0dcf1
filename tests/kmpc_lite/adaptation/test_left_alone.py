"""A good model is left alone, however long nothing happens and whatever is measured."""

import numpy as np
import pytest
from slipping_floors import DT, NOISY, U_MAX, go, model_of

from kmpc_lab import DifferentialDrive
from kmpc_lite.adaptation.online import OnlineAdaptation

LASTING = [1500, pytest.param(10_000, marks=pytest.mark.long)]
"""Steps in which nothing happens."""


@pytest.mark.parametrize("steps", LASTING)
@pytest.mark.parametrize("slip", [0.0, 0.05, 0.2])
def test_a_good_model_is_left_alone(slip, steps):
    adaptation = OnlineAdaptation(model_of(slip))
    assert not go(adaptation, DifferentialDrive(slip, seed=3), steps, 3)
    assert adaptation.model is model_of(slip)
    assert adaptation.counts.used > 0.9 * steps


@pytest.mark.parametrize("steps", LASTING)
def test_a_good_model_is_left_alone_under_pose_noise(steps):
    adaptation = OnlineAdaptation(model_of(0.05))
    assert not go(adaptation, DifferentialDrive(0.05, seed=3), steps, 3, NOISY)


@pytest.mark.parametrize(
    ("slip", "steps"),
    [(0.05, 1500), *[pytest.param(s, 4000, marks=pytest.mark.long) for s in (0.0, 0.05, 0.1)]],
)
def test_long_turns_on_the_spot_are_no_reason_to_relearn_driving(slip, steps):
    """Commands held for 3 s, poses noisier than the log's.

    In some windows hardly a step tells how far the robot comes.
    """
    adaptation = OnlineAdaptation(model_of(slip))
    assert not go(adaptation, DifferentialDrive(slip, seed=0), steps, 0, NOISY, hold=30)
    turning = np.tile([0.0, 0.5], (400, 1))
    assert not go(adaptation, DifferentialDrive(slip, seed=1), 400, 1, NOISY, turning)


@pytest.mark.parametrize("steps", [8000, pytest.param(100_000, marks=pytest.mark.long)])
def test_standing_still_changes_nothing(steps):
    adaptation, random = OnlineAdaptation(model_of(0.05)), np.random.default_rng(0)
    go(adaptation, DifferentialDrive(0.05, seed=1), 200, 0)
    kept, used = adaptation.state.steps.copy(), adaptation.counts.used
    poses = np.array([0.3, 0.2, 0.1]) + random.normal(size=(steps + 1, 3)) * NOISY
    still = np.zeros(2)
    assert not any(adaptation.update(a, still, b) for a, b in zip(poses, poses[1:], strict=False))
    assert adaptation.counts.still == steps and adaptation.counts.used == used
    np.testing.assert_array_equal(adaptation.state.steps, kept)


def test_broken_measurements_are_rejected():
    random = np.random.default_rng(1)
    adaptation, plant = OnlineAdaptation(model_of(0.05)), DifferentialDrive(0.05, seed=4)
    x, given = np.zeros(3), 0
    for k in range(4000):
        if k % 60 == 0:
            x = random.uniform(-1, 1, 3)
        u = random.uniform(-1, 1, 2) * U_MAX
        after = plant.step(x, u, DT)
        seen = after.copy()
        match k % 23:
            case 3:
                seen[k % 3] = (np.nan, np.inf, -np.inf)[k % 3]
            case 7:
                seen[:2] += random.choice([-1, 1], 2) * random.uniform(0.2, 5.0)
            case 11:
                seen[2] += random.choice([-1, 1]) * random.uniform(0.5, 2.5)
            case 17:
                # small jumps pass for a floor, but do not add up to one
                seen[:2] += random.normal(size=2) * 0.02
        given += adaptation.update(x, u, seen) is not None
        x = after
    assert not given
    assert adaptation.counts.rejected >= 3 * (4000 // 23) - 60
    for command in ([np.nan, 0.0], [np.inf, 1.0], [1e308, -1e308], [0.0, np.inf]):
        assert adaptation.update(np.zeros(3), np.array(command), np.zeros(3)) is None
