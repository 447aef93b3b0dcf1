"""Plants: the paper's slipping robot, and one that behaves as a learned model does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab import LearnedPlant
from kmpc_lab.sim.closed_loop import Outcome, drive
from kmpc_lab.sim.plants.lag import Floor, LaggingDrive
from kmpc_lite import nominal_unicycle
from kmpc_lite.control.estimate.history import advance_pose
from kmpc_lite.control.path.capabilities import seen_from
from kmpc_lite.errors import ProblemError
from kmpc_lite.scenario.files import Scenario

U = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
X = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-4.0, 4.0))


@given(x=X, u=U, dt=st.floats(0.01, 0.5), substeps=st.integers(1, 8))
def test_without_slip_it_drives_the_exact_arc(
    x: tuple[float, ...], u: tuple[float, ...], dt: float, substeps: int
) -> None:
    trace = kmpc_lab.DifferentialDrive().trace(x, u, dt, substeps)
    assert trace.shape == (substeps, 3)
    for i, state in enumerate(trace, start=1):
        t = dt * i / substeps
        # chord of an arc
        half = 0.5 * u[1] * t
        chord = u[0] * t * np.sinc(half / np.pi)
        expected = [
            x[0] + chord * np.cos(x[2] + half),
            x[1] + chord * np.sin(x[2] + half),
            x[2] + u[1] * t,
        ]
        np.testing.assert_allclose(state, expected, atol=1e-12)


@given(
    x=X,
    omega=st.floats(-1.0, 1.0),
    slip=st.floats(0.0, 0.2),
    ahead=st.floats(-0.1, 0.1),
    left=st.floats(-0.1, 0.1),
)
def test_a_turn_on_the_spot_leaves_the_turning_point_where_it_is(
    x: tuple[float, ...], omega: float, slip: float, ahead: float, left: float
) -> None:
    for plant in (
        kmpc_lab.DifferentialDrive(slip, 3, 0.6, (ahead, left)),
        LaggingDrive(0.2, 0.05, slip, 0.6, 3, turning_point=(ahead, left)),
    ):
        states = plant.trace(x, (0.0, omega), 0.4, 4)
        point = seen_from(states, np.array([ahead, left]))[:, :2]
        np.testing.assert_allclose(
            point,
            np.broadcast_to(seen_from(np.array(x), np.array([ahead, left]))[:2], (4, 2)),
            atol=1e-9,
        )


def test_slip_is_the_papers_drawn_anew_every_period_and_held_during_it() -> None:
    plant, slip = kmpc_lab.DifferentialDrive(0.1, seed=1), 0.1
    x, u = np.zeros((20_000, 3)), np.tile((0.5, 0.4), (20_000, 1))
    first, second = plant.trace(x, u, 0.1, 2)
    # at heading 0 and over a short time: forward (1 + beta) v, left -alpha v, turn (1 + gamma)
    # omega
    moved = kmpc_lab.DifferentialDrive(0.1, seed=1).step(x, u, 1e-3) / 1e-3
    alpha, beta, gamma = -moved[:, 1] / 0.5, moved[:, 0] / 0.5 - 1, moved[:, 2] / 0.4 - 1
    for ratio in (beta, gamma):
        assert ratio.min() > -1e-6
        assert ratio.mean() == pytest.approx(slip, rel=0.03)
        assert ratio.std() == pytest.approx(slip, rel=0.05)  # exponential: as large as its mean
    assert alpha.mean() == pytest.approx(slip, rel=0.03)
    assert abs(np.corrcoef(alpha, beta)[0, 1]) < 0.03
    # held: the heading grows evenly within the period
    np.testing.assert_allclose(second[:, 2], 2 * first[:, 2], rtol=1e-9)
    # drawn anew: another period, another slip
    assert abs(np.corrcoef(first[:, 2], plant.trace(x, u, 0.1, 1)[0, :, 2])[0, 1]) < 0.03


def test_without_noise_it_is_the_model_with_its_own_history() -> None:
    dictionary = kl.InputHistoryDictionary(kl.HermiteTrigDictionary(order=0), lags=(1,))
    nominal = kl.nominal_unicycle(0.1)
    random = np.random.default_rng(0)
    episodes = []
    for _ in range(20):
        inputs = random.uniform(-1, 1, (30, 2))
        episodes.append(
            kl.Episode(
                nominal.rollout(np.zeros(3), np.vstack([np.zeros((1, 2)), inputs[:-1]])),
                inputs,
                0.1,
            )
        )
    model = kl.fit(kl.Dataset(episodes), dictionary, noise=False)
    plant, x = LearnedPlant(model), np.zeros(3)
    inputs = random.uniform(-1, 1, (15, 2))
    path = [x]
    for u in inputs:
        trace = plant.trace(path[-1], u, 0.1, 4)
        # sub-samples lie evenly on the way
        np.testing.assert_allclose(
            np.diff(np.vstack([path[-1], trace]), axis=0),
            np.tile((trace[-1] - path[-1]) / 4, (4, 1)),
            atol=1e-12,
        )
        path.append(trace[-1])
    np.testing.assert_allclose(path, model.rollout(np.zeros(3), inputs), atol=1e-9)
    assert np.abs(path[1]).max() < 1e-3  # the first command has not acted yet


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


ROBOT = """[map]
circles = [[0.5, 0.3, 0.3], [-0.3, 0.6, 0.25]]
bounds = [-2.0, -2.0, 2.0, 2.0]
[robot]
start = [-1.5, -1.0, 0.0]
goal = [1.5, 1.2, 1.0]
wheels = {wheels}
[plant]
slip = 0.03
"""


def scenario(tmp_path, wheels):
    file = tmp_path / "robot.toml"
    file.write_text(ROBOT.format(wheels=wheels))
    return Scenario.load(file)


@pytest.mark.parametrize(
    ("wheels", "expected"),
    [
        ('"omni"', kl.Omni()),
        ('{kind = "car", turning_radius = 0.8}', kl.Car(0.8)),
        ('{kind = "car", turning_radius = 0.8, steering_rate = 4.0}', kl.Car(0.8, 4.0)),
    ],
)
def test_a_scenario_names_its_wheels_and_is_driven(tmp_path, wheels, expected):
    found = scenario(tmp_path, wheels)
    assert found.wheels == expected
    (tmp_path / "again.toml").write_text(found.to_toml())
    assert Scenario.load(tmp_path / "again.toml").wheels == expected
    make = kl.nominal_omni if isinstance(expected, kl.Omni) else kl.nominal_unicycle
    problem = found.problem()
    run = drive(kl.Controller(make(0.1), problem), found, None, 0.1)
    assert run.outcome is Outcome.REACHED
    assert run.inputs.shape[1] == expected.inputs


@pytest.mark.parametrize("wheels", ['"hover"', '{kind = "car"}', '{kind = "car", radius = 1}', "3"])
def test_other_wheels_are_refused_with_their_place(tmp_path, wheels):
    with pytest.raises(kl.ScenarioError, match=r"\[robot\] wheels"):
        scenario(tmp_path, wheels)
