"""A changed floor is learned within seconds, and what a drive does not show is not unlearned."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from slipping_floors import DT, NOISY, U_MAX, errors, go, learned, model_of, noisy_model

from kmpc_lab import DifferentialDrive, generate_dataset
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite import (
    InputHistoryDictionary,
    UnicycleDictionary,
    fit,
    nominal_omni,
    nominal_unicycle,
)
from kmpc_lite.adaptation.online import Gains, OnlineAdaptation
from kmpc_lite.scale import Scale


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ((0.0, 1.0), (0.2, 1.0)),
        ((0.05, 1.0), (0.2, 1.0)),
        ((0.05, 1.0), (0.05, 0.6)),
        ((0.2, 1.0), (0.2, 0.6)),
    ],
)
def test_a_changed_floor_is_learned_in_five_seconds(before, after):
    fresh = errors(learned(*after, seed=9), *after)
    ratios = []
    for seed in range(6):
        adaptation = OnlineAdaptation(model_of(*before))
        known = DifferentialDrive(before[0], seed=seed, turn_gain=before[1])
        assert not go(adaptation, known, 300, seed)
        changed = DifferentialDrive(after[0], seed=seed + 50, turn_gain=after[1])
        assert len(go(adaptation, changed, 50, seed + 100)) <= 8
        ratios.append(errors(adaptation.model, *after) / fresh)
    assert np.median(ratios, axis=0).max() <= 1.15
    assert np.max(ratios) <= 1.5
    stale = errors(model_of(*before), *after) / fresh
    assert stale.max() > 1.2
    assert np.median(ratios, axis=0).max() < 0.9 * stale.max()


def test_a_straight_line_does_not_unlearn_turning():
    adaptation = OnlineAdaptation(model_of(0.05))
    straight, noise = np.tile([0.5, 0.0], (3000, 1)), (0.002, 0.002, 0.01)
    go(adaptation, DifferentialDrive(0.2, seed=2), 3000, 1, noise, straight)
    # the slip ahead and sideways is learned; of the turns nothing was seen
    assert adaptation.gains.ahead == pytest.approx(1.2 / 1.05, abs=0.05)
    assert adaptation.gains.turn == pytest.approx(1.0, abs=0.02)
    go(adaptation, DifferentialDrive(0.2, seed=3), 150, 2)
    assert adaptation.gains.turn == pytest.approx(1.2 / 1.05, abs=0.1)


def test_turning_on_the_spot_does_not_unlearn_driving():
    adaptation, turning = OnlineAdaptation(model_of(0.05)), np.tile([0.0, 0.6], (1000, 1))
    plant = DifferentialDrive(0.05, seed=2, turn_gain=0.6)
    go(adaptation, plant, 1000, 1, commands=turning)
    assert adaptation.gains.turn == pytest.approx(0.6, abs=0.03)
    assert adaptation.gains[:2] == pytest.approx((1.0, 0.0), abs=0.02)


def test_with_input_history():
    """A robot that obeys one period late, and whose turns then shrink."""
    late = InputHistoryDictionary(UnicycleDictionary(), lags=(0, 1))
    random, plant = np.random.default_rng(0), DifferentialDrive(0.02, seed=1)
    data = generate_dataset(plant, episodes=100, steps=200, dt=DT, seed=2)
    delayed = type(data)(
        [replace(e, inputs=np.vstack([e.inputs[1:], e.inputs[:1]])) for e in data.episodes]
    )
    adaptation = OnlineAdaptation(fit(delayed, late))
    x, past = np.zeros(3), np.zeros((1, 2))
    for k in range(400):
        if k % 60 == 0:
            x = random.uniform(-1, 1, 3)
        u = random.uniform(-1, 1, 2) * U_MAX
        plant.turn_gain = 0.6 if k >= 200 else 1.0
        after = plant.step(x, past[0], DT)
        given = adaptation.update(x, u, after, past)
        assert given is None or k >= 200
        x, past = after, u[None]
    assert adaptation.gains.turn == pytest.approx(0.6, abs=0.02)


def test_an_omni_that_goes_sideways_otherwise_than_ahead_has_one_model_in_all_directions():
    """Rollers give a tenth less of a way sideways: no direction contradicts what others showed."""
    model, random = nominal_omni(DT), np.random.default_rng(0)
    adaptation, x, found = OnlineAdaptation(model), np.zeros(3), []
    happens = np.array((1.0, 0.9, 0.95))
    for k in range(200):
        if k % 25 == 0:
            u = random.uniform(-1, 1, 3) * (0.6, 0.6, 1.5)
        after = model.predict(x, u * happens)
        adaptation.update(x, u, after)
        found.append(adaptation.gains)
        x = after
    expected = np.tile(Gains(turn=0.95, aside=0.9), (100, 1))
    np.testing.assert_allclose(found[100:], expected, atol=1e-2)
    moved = adaptation.model.predict(x, u)
    np.testing.assert_allclose(moved, model.predict(x, u * happens), atol=1e-3)


def test_a_heading_that_has_turned_full_circles_is_still_the_same_heading():
    # a model fitted on noise knows a little of the heading itself: nothing true of one that was
    # never in its log
    model = model_of(0.2)
    h = model.H.copy()
    h[0, model.dictionary.size + model.dictionary.names.index("theta")] += 0.02
    adaptation, turned = (OnlineAdaptation(replace(model, H=h)) for _ in range(2))
    random, x, plant = np.random.default_rng(0), np.zeros(3), DifferentialDrive(0.2, seed=3)
    for _ in range(100):
        u = random.uniform(-1, 1, 2) * U_MAX
        after = plant.step(x, u, DT)
        adaptation.update(x, u, after)
        turned.update(x + (0, 0, 6 * np.pi), u, after + (0, 0, 6 * np.pi))
        x = after
    assert adaptation.counts == turned.counts
    kept = (a.state.steps.view(float) for a in (adaptation, turned))
    np.testing.assert_allclose(*kept, rtol=1e-6, atol=1e-9)


def test_the_same_robot_scaled_learns_the_same_gains():
    scale = Scale(4.0, 2.0)
    one = OnlineAdaptation(nominal_unicycle(DT))
    large = OnlineAdaptation(nominal_unicycle(DT * scale.time), scale=scale)
    random, x, plant = np.random.default_rng(0), np.zeros(3), DifferentialDrive(turn_gain=0.7)
    for _ in range(100):
        u = random.uniform(-1, 1, 2) * U_MAX
        after = plant.step(x, u, DT) + random.normal(size=3) * 0.002
        first = one.update(x, u, after)
        second = large.update(x * scale.state, u * scale.command, after * scale.state)
        assert (first is None) == (second is None)
        x = after
    assert one.counts == large.counts and one.counts.models > 0
    assert one.gains[:3] == large.gains[:3] and 4.0 * large.gains.pull == one.gains.pull


def test_noise_of_poses_that_the_log_had_is_seen_through():
    """A turn of 16 mrad less per step, among 28 mrad of noise.

    Five seconds are enough if it is known how poses err.
    """
    model, fresh = noisy_model(), errors(learned(0.2, 0.6, seed=9), 0.2, 0.6)
    ratios = []
    for seed in range(8):
        adaptation = OnlineAdaptation(model)
        assert not go(adaptation, DifferentialDrive(), 100, seed, NOISY)
        go(adaptation, DifferentialDrive(0.2, seed=seed, turn_gain=0.6), 50, seed + 100, NOISY)
        ratios.append((errors(adaptation.model, 0.2, 0.6) / fresh)[3:].max())
    assert np.median(ratios) <= 1.25
    assert np.quantile(ratios, 0.8) <= 1.5


@pytest.mark.parametrize("lag", [0.1, 0.3])
@pytest.mark.parametrize("hold", [8, 20])
def test_gains_are_those_of_the_floor_where_the_lag_is_wrong_by_half(lag, hold):
    log = drive_log(LaggingDrive(lag=0.2), episodes=20, steps=300, seed=2)
    late = InputHistoryDictionary(UnicycleDictionary(), lags=tuple(range(6)))
    model, off = fit(log, late), []
    for seed in range(6):
        adaptation, random = OnlineAdaptation(model), np.random.default_rng(seed)
        x, plant = np.zeros(3), LaggingDrive(lag, slip=0.02, turn_gain=0.8, seed=seed)
        sent = np.zeros((5, 2))
        for k in range(300):
            u = random.uniform(-1, 1, 2) * U_MAX if k % hold == 0 else sent[-1]
            after = plant.step(x, u, DT)
            adaptation.update(x, u, after, sent)
            x, sent = after, np.vstack([sent[1:], u])
        off.append((adaptation.gains.ahead / 1.02 - 1.0, adaptation.gains.turn / 0.816 - 1.0))
    assert np.quantile(np.abs(off).max(axis=1), 0.8) < 0.05


class Mirrored(DifferentialDrive):
    """A robot that turns the other way round: the log of another robot, or a sign in its wiring."""

    def step(self, x, u, dt):
        return super().step(x, (u[0], -u[1]), dt)


def test_a_mirrored_robot_is_reported_within_seconds():
    adaptation = OnlineAdaptation(model_of(0.05))
    go(adaptation, Mirrored(0.05, seed=3), 80, 1)
    assert "turns -" in adaptation.wrong_model
    assert adaptation.model is adaptation.base
    adaptation.reset()
    assert not adaptation.wrong_model


def test_an_adapted_model_that_predicts_worse_gives_way_to_the_learned_one():
    adaptation = OnlineAdaptation(model_of(0.05))
    state = adaptation.state
    state.gains = Gains(turn=0.6)  # of a floor that is gone, and too little to raise an alarm
    adaptation.options = replace(adaptation.options, window_alarm=1e9, memory_alarm=1e9)
    go(adaptation, DifferentialDrive(0.05, seed=3), 200, 1)
    assert adaptation.gains == Gains() and adaptation.model is adaptation.base


LASTING = [1500, pytest.param(10_000, marks=pytest.mark.long)]  # steps in which nothing happens


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
