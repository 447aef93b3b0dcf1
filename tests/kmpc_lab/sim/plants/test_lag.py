import numpy as np
import pytest

from kmpc_lab.sim.plants.lag import Floor, LaggingDrive
from kmpc_lite import nominal_unicycle
from kmpc_lite.control.estimate.history import advance_pose
from kmpc_lite.errors import ProblemError

DT, LAG, DEAD = 0.1, 0.3, 0.15


def run(plant, commands, dt=DT):
    x, path = np.zeros(3), [np.zeros(3)]
    for u in commands:
        x = plant.step(x, u, dt)
        path.append(x)
    return np.array(path)


def test_first_order_response_after_the_dead_time():
    plant = LaggingDrive(LAG, DEAD)
    path = run(plant, np.tile([0.5, 0.0], (30, 1)))
    moving = np.maximum(np.arange(31) * DT - DEAD, 0.0)
    expected = 0.5 * (moving - LAG * (1.0 - np.exp(-moving / LAG)))
    np.testing.assert_allclose(path[:, 0], expected, atol=1e-9)
    np.testing.assert_allclose(path[:, 1:], 0.0, atol=1e-12)


def test_the_floor_changes_while_driving():
    plant = LaggingDrive(slip=0.0, floors=[Floor(1.0, 0.2), Floor(2.0, 0.0, 0.6)])
    path = run(plant, np.tile([0.5, 0.3], (30, 1)))
    steps = np.hypot(*np.diff(path[:, :2], axis=0).T)
    assert steps[:10] == pytest.approx(np.full(10, steps[0])) and steps[20:].std() < 1e-12
    assert steps[10:20].std() > 1e-3 and steps[10:20].mean() > steps[0]
    assert np.diff(path[:, 2])[20:] == pytest.approx(np.full(10, 0.6 * 0.03))
    plant.reset()
    assert plant.floor.slip == 0.0


@pytest.mark.parametrize("age", [0.0, 0.1, 0.2, 0.5])
def test_an_old_pose_is_brought_forward(age):
    plant, commands = LaggingDrive(), np.random.default_rng(6).uniform(-0.6, 0.6, (12, 2))
    path = run(plant, commands)
    back = round(age / DT)
    np.testing.assert_allclose(
        advance_pose(nominal_unicycle(DT), path[12 - back], commands, age), path[12], atol=1e-6
    )


@pytest.mark.parametrize(
    "options", [{"lag": -0.1}, {"dead_time": np.nan}, {"slip": -1.0}, {"turn_gain": 0.0}]
)
def test_bad_options(options):
    with pytest.raises(ProblemError, match=next(iter(options))):
        LaggingDrive(**options)
    with pytest.raises(ProblemError, match="rising"):
        LaggingDrive(floors=[Floor(2.0, 0.1), Floor(1.0, 0.1)])
    with pytest.raises(ValueError, match="expected states"):
        LaggingDrive().step(np.zeros(2), np.zeros(2), DT)
