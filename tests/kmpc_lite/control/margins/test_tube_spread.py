"""The spread of plans against the same sums written out, and against what calibration expects."""

from dataclasses import replace

import numpy as np
import pytest
from wary import of_noise

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.model.linearization import Linearization
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.model.noise_sources import NoiseSources
from kmpc_lite.model.tube import (
    FLOOR,
    MEMORY,
    closed_loop,
    feedback_delay,
    rotations,
    tube_noise,
    window_deviations,
)
from kmpc_lite.types import Array

SOURCES = NoiseSources(
    np.array([1e-4, 1e-4, 4e-5]),
    np.array([4e-4, 0.0, 0.0]),
    np.array([[4e-4, 1e-4, 2e-4], [0.0, 1e-5, 4e-4]]),
    np.array([[2.5e-3, 1e-4, 4e-3], [1e-3, 4e-4, 9e-3]]),
)


def robot(dead: int) -> kl.KoopmanModel:
    """A robot with these sources, whose commands act so many periods late."""
    model = kl.nominal_unicycle(0.1)
    if dead:
        driven = kmpc_lab.generate_dataset(kmpc_lab.DifferentialDrive(0.0), 20, 80, 0.1, seed=2)
        # what acts in a period was given before
        given = [kl.Episode(e.states[:-dead], e.inputs[dead:], 0.1) for e in driven.episodes]
        lags = tuple(range(dead + 1))
        model = kl.fit(kl.Dataset(given), kl.InputHistoryDictionary(kl.UnicycleDictionary(), lags))
    return replace(model, noise_model=NoiseModel(np.zeros((3, 3, 3)), SOURCES))


def commands_before(inputs: Array, history: int) -> Array:
    """Commands (N, L, 2) before each period of a robot that stood."""
    whole = np.vstack([np.zeros((history, 2)), inputs])
    return np.array([whole[k : k + history] for k in range(len(inputs))])


def plan(model: kl.KoopmanModel) -> tuple[Linearization, Array, Array]:
    """A curve of 20 stages with its linearisation."""
    inputs = np.column_stack([np.linspace(0.2, 0.6, 20), np.linspace(0.5, -0.5, 20)])
    past = commands_before(inputs, model.history)
    states = model.rollout(np.zeros(3), inputs, past[0])
    return model.linearize(states[:-1], inputs, past), states, inputs


@pytest.mark.parametrize("dead", [0, 1, 3])
def test_feedback_acts_when_a_command_has_had_half_of_its_effect(dead: int) -> None:
    assert feedback_delay(robot(dead)) == dead


@pytest.mark.parametrize("dead", [0, 2])
def test_stages_spread_by_what_every_period_adds(dead: int) -> None:
    model = robot(dead)
    lin, states, inputs = plan(model)
    found = of_noise(model).covariances(lin, states, inputs)
    cos, sin = np.cos(states[:-1, 2]), np.sin(states[:-1, 2])
    turned, steered = rotations(cos, sin), closed_loop(lin.A, cos, sin)
    for stage in (1, 2, 5, 20):
        total, columns = np.zeros((3, 3)), np.zeros((3, 6))
        for period in range(max(0, stage - MEMORY - dead), stage):
            white = [
                u**2 * np.diag(row) for u, row in zip(inputs[period], SOURCES.white, strict=True)
            ]
            lasting = [
                0.1 * u * np.diag(np.sqrt(row))
                for u, row in zip(inputs[period], SOURCES.lasting, strict=True)
            ]
            carried = turned[period]
            for later in range(period + 1, stage):
                carried = (steered if later - period > dead else lin.A)[later] @ carried
            total += carried @ sum(white) @ carried.T
            columns += carried @ np.hstack(lasting)
        pose = SOURCES.pose + inputs[stage - 1, 0] ** 2 * SOURCES.pose_by_speed + FLOOR**2
        turn = turned[stage - 1]
        total += columns @ columns.T + turn @ np.diag(pose) @ turn.T
        np.testing.assert_allclose(found[stage - 1], total[:2, :2], rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("dead", [0, 2])
def test_calibration_expects_what_plans_keep_and_one_more_measured_pose(dead: int) -> None:
    model = robot(dead)
    lin, states, inputs = plan(model)
    steps = MEMORY + dead
    kept = of_noise(model).covariances(lin, states, inputs)[:steps]
    past = commands_before(inputs, model.history)[None, :steps]
    deviations, expected = window_deviations(
        model, states[None, :steps], inputs[None, :steps], states[None, 1 : steps + 1], past
    )
    # a plan that is driven as planned
    np.testing.assert_allclose(deviations, 0.0, atol=1e-9)
    noise = tube_noise(model.noise_model, 0.1)
    headings = states[:steps, 2]
    turned = rotations(np.cos(headings), np.sin(headings))
    pose = noise.pose + inputs[:steps, 0, None, None] ** 2 * noise.pose_by_speed
    one_more = (turned @ pose @ turned.swapaxes(-1, -2))[:, :2, :2]
    np.testing.assert_allclose(expected[0], kept + one_more, rtol=1e-6, atol=1e-12)


def test_errors_that_last_spread_farther_than_white_ones_of_the_same_size() -> None:
    model = robot(0)
    lin, states, inputs = plan(model)
    none = np.zeros((2, 3))
    size = np.full((2, 3), 1e-3)
    white = NoiseSources(np.zeros(3), np.zeros(3), 0.01 * size, none)
    lasting = NoiseSources(np.zeros(3), np.zeros(3), none, size)
    spread = [
        of_noise(replace(model, noise_model=NoiseModel(np.zeros((3, 3, 3)), s))).covariances(
            lin, states, inputs
        )
        for s in (white, lasting)
    ]
    np.testing.assert_allclose(spread[0][0], spread[1][0], rtol=1e-6)
    assert np.trace(spread[1][-1]) > 1.5 * np.trace(spread[0][-1])
