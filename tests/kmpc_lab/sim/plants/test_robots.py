"""Plants: the paper's slipping robot, and one that behaves as a learned model does."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab import LearnedPlant
from kmpc_lab.sim.plants.lag import LaggingDrive
from kmpc_lite.control.path.capabilities import seen_from

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
