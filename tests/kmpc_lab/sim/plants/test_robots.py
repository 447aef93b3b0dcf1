"""Plants: the paper's slipping robot, and one that behaves as a learned model does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab import LearnedPlant
from kmpc_lab.sim.plants.lag import LaggingDrive
from kmpc_lite.control.path.turning_centre import seen_from
from kmpc_lite.model.noise_model import NoiseModel

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


@pytest.mark.parametrize(
    "values",
    [{"slip": -0.1}, {"slip": np.nan}, {"slip": np.inf}, {"turn_gain": 0.0}, {"turn_gain": np.nan}],
)
def test_impossible_floors_are_refused_by_name(values: dict[str, float]) -> None:
    with pytest.raises(kl.ProblemError, match=next(iter(values))):
        kmpc_lab.DifferentialDrive(**values)  # type: ignore[arg-type]


def test_wrong_shapes_are_refused() -> None:
    with pytest.raises(ValueError, match="expected states"):
        kmpc_lab.DifferentialDrive().step((0, 0), (0, 0), 0.1)
    with pytest.raises(ValueError, match="expected states"):
        kmpc_lab.DifferentialDrive().step((0, 0, 0), (0, 0, 0), 0.1)


def test_random_drives_are_the_papers() -> None:
    data = kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(), episodes=200, steps=20, dt=0.1, seed=4
    )
    starts = np.array([e.states[0] for e in data.episodes])
    inputs = np.concatenate([e.inputs for e in data.episodes])
    assert len(data) == 200 and data.steps == 4000 and data.dt == 0.1
    for values in (starts, inputs):
        assert np.abs(values).max() <= 1.0
        assert np.abs(values.mean(axis=0)).max() < 0.15
        np.testing.assert_allclose(values.std(axis=0), 1 / np.sqrt(3), rtol=0.1)
    for e in data.episodes[:3]:
        np.testing.assert_allclose(
            kl.nominal_unicycle(0.1).rollout(e.states[0], e.inputs), e.states, atol=1e-6
        )


@pytest.fixture(scope="module")
def noisy() -> kl.KoopmanModel:
    """The nominal robot with noise of its own: some at rest, some that grows with the speeds."""
    nominal = kl.nominal_unicycle(0.1)
    coefficients = np.zeros((3, 3, 3))
    coefficients[0] = np.diag([1e-2, 1e-2, 1e-2])
    coefficients[1] = np.diag([4e-4, 1e-4, 0.0])
    coefficients[2] = np.diag([0.0, 0.0, 9e-4])
    return kl.KoopmanModel(
        nominal.dictionary,
        0.1,
        nominal.A,
        nominal.B,
        nominal.H,
        nominal.C,
        True,
        NoiseModel(coefficients),
    )


@settings(max_examples=20, deadline=None)
@given(x=X, substeps=st.integers(1, 6))
def test_at_rest_a_learned_plant_stands(
    noisy: kl.KoopmanModel, x: tuple[float, ...], substeps: int
) -> None:
    np.testing.assert_allclose(
        LearnedPlant(noisy).trace(x, (0.0, 0.0), 0.1, substeps),
        np.tile(x, (substeps, 1)),
        atol=1e-9,
    )


def test_its_noise_is_the_models_in_the_robots_frame(noisy: kl.KoopmanModel) -> None:
    plant, x, u = (
        LearnedPlant(noisy, seed=2),
        np.array([1.0, -1.0, np.pi / 2]),
        np.array([0.5, 0.4]),
    )
    errors = np.array([plant.trace(x, u, 0.1, 3)[-1] - noisy.predict(x, u) for _ in range(4000)])
    # forward is y at a heading of a quarter turn, left is -x
    np.testing.assert_allclose(
        errors.std(axis=0),
        [np.sqrt(1e-4) * 0.5, np.sqrt(4e-4) * 0.5, np.sqrt(9e-4) * 0.4],
        rtol=0.06,
    )
    assert np.abs(errors.mean(axis=0)).max() < 1e-3


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
