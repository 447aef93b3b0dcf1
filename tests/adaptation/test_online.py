import pickle
from dataclasses import replace

import numpy as np
import pytest

from kmpc_lite import (
    DifferentialDrive,
    InputHistoryDictionary,
    KoopmanModel,
    UnicycleDictionary,
    fit,
    generate_dataset,
    nominal_unicycle,
)
from kmpc_lite.adaptation.gains import RESTLESS, USUAL, whitening
from kmpc_lite.adaptation.online import Gains, OnlineAdaptation
from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.errors import ModelError, ProblemError
from kmpc_lite.learn.evaluation import evaluate
from kmpc_lite.model.dictionary import HermiteTrigDictionary
from kmpc_lite.scale import Scale
from kmpc_lite.sim.plants.lag import LaggingDrive, drive_log

DT, U_MAX = 0.1, (0.6, 0.785)


def learned(slip=0.0, turn_gain=1.0, seed=5):
    plant = DifferentialDrive(slip, seed=seed, turn_gain=turn_gain)
    return fit(generate_dataset(plant, episodes=100, steps=300, dt=DT, seed=seed + 1))


MODELS: dict[tuple[float, float], KoopmanModel] = {}


def model_of(slip, turn_gain=1.0):
    key = slip, turn_gain
    if key not in MODELS:
        MODELS[key] = learned(slip, turn_gain)
    return MODELS[key]


def go(adaptation, plant, steps, seed, noise=(0.0, 0.0, 0.0), commands=None, hold=8):
    """Drive about with commands held for `hold` periods, within the area that was learned.

    The models given.
    """
    random = np.random.default_rng(seed)
    u = (
        np.repeat(random.uniform(-1, 1, (steps // hold + 1, 2)) * U_MAX, hold, axis=0)
        if commands is None
        else commands
    )
    given, x = [], random.uniform(-1, 1, 3)
    seen = x + random.normal(size=3) * noise
    for k in range(steps):
        x = plant.step(x, u[k], DT)
        after = x + random.normal(size=3) * noise
        model = adaptation.update(seen, u[k], after)
        if model is not None:
            given.append(model)
        seen = after
        if k % 60 == 59:
            x = random.uniform(-1, 1, 3)
            seen = x + random.normal(size=3) * noise
    return given


def errors(model, slip, turn_gain, seed=77):
    """Longitudinal, lateral, heading RMS after one step and after 1 s, on fresh drives."""
    plant = DifferentialDrive(slip, seed=seed, turn_gain=turn_gain)
    report = evaluate(
        model,
        generate_dataset(plant, episodes=60, steps=60, dt=DT, seed=seed + 1, u_max=U_MAX),
        1.0,
        stride=5,
    )
    return np.array(report.one_step + report.multi_step)


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
        assert not go(
            adaptation, DifferentialDrive(before[0], seed=seed, turn_gain=before[1]), 300, seed
        )
        given = go(
            adaptation,
            DifferentialDrive(after[0], seed=seed + 50, turn_gain=after[1]),
            50,
            seed + 100,
        )
        assert len(given) <= 8
        ratios.append(errors(adaptation.model, *after) / fresh)
    assert np.median(ratios, axis=0).max() <= 1.15
    assert np.max(ratios) <= 1.5
    stale = errors(model_of(*before), *after) / fresh
    assert stale.max() > 1.2
    assert np.median(ratios, axis=0).max() < 0.9 * stale.max()


def test_without_noise_the_new_turn_gain_is_exact():
    adaptation = OnlineAdaptation(model_of(0.0))
    go(adaptation, DifferentialDrive(), 100, 0)
    go(adaptation, DifferentialDrive(turn_gain=0.6), 50, 1)
    assert errors(adaptation.model, 0.0, 0.6).max() < 1e-5
    assert adaptation.gains.turn == pytest.approx(0.6, abs=1e-5)


def test_margins_learn_with_the_floor():
    adaptation = OnlineAdaptation(model_of(0.02))
    go(adaptation, DifferentialDrive(0.2, seed=3), 400, 4)
    deviation = np.sqrt(np.diag(adaptation.model.noise((0.5, 0.0))))
    truth = np.sqrt(np.diag(model_of(0.2).noise((0.5, 0.0))))
    assert (deviation[:2] > 0.8 * truth[:2]).all() and (deviation[:2] < 2.0 * truth[:2]).all()


LASTING = [1500, pytest.param(10_000, marks=pytest.mark.long)]
"""Steps in which nothing happens."""
LASTING_NOISE = pytest.param(0.0, 10_000, marks=pytest.mark.long)


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
    assert not go(adaptation, DifferentialDrive(0.05, seed=3), steps, 3, noise=(0.005, 0.005, 0.02))


@pytest.mark.parametrize(
    ("slip", "steps"),
    [(0.05, 1500), *[pytest.param(s, 4000, marks=pytest.mark.long) for s in (0.0, 0.05, 0.1)]],
)
def test_long_turns_on_the_spot_are_no_reason_to_relearn_driving(slip, steps):
    """Commands held for 3 s, poses noisier than the log's.

    In some windows hardly a step tells how far the robot comes.
    """
    adaptation = OnlineAdaptation(model_of(slip))
    assert not go(
        adaptation, DifferentialDrive(slip, seed=0), steps, 0, noise=(0.005, 0.005, 0.02), hold=30
    )
    turning = np.tile([0.0, 0.5], (400, 1))
    assert not go(
        adaptation,
        DifferentialDrive(slip, seed=1),
        400,
        1,
        noise=(0.005, 0.005, 0.02),
        commands=turning,
    )


def test_drives_under_pose_noise_learn_too():
    adaptation = OnlineAdaptation(model_of(0.05))
    # a turn of 18 mrad less per step, among 28 mrad of noise
    go(
        adaptation,
        DifferentialDrive(0.05, seed=3, turn_gain=0.6),
        300,
        3,
        noise=(0.005, 0.005, 0.02),
    )
    assert adaptation.gains.turn == pytest.approx(0.6, abs=0.08)


NOISY = (0.005, 0.005, 0.02)


def noisy_model(slip=0.0):
    """Learned from a log whose poses were noisy too."""
    log = drive_log(
        LaggingDrive(slip=slip, seed=5), episodes=60, steps=300, seed=6, pose_noise=NOISY
    )
    return fit(log, HermiteTrigDictionary(order=0))


def test_noise_of_poses_that_the_log_had_is_seen_through():
    """A turn of 16 mrad less per step, among 28 mrad of noise.

    Five seconds are enough where it is known how poses err.
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


@pytest.mark.parametrize(("slip", "steps"), [(0.0, 1500), (0.1, 1500), LASTING_NOISE])
def test_a_good_model_of_a_noisy_log_is_left_alone(slip, steps):
    model = noisy_model(slip)
    adaptation = OnlineAdaptation(model)
    assert not go(adaptation, DifferentialDrive(slip, seed=3), steps, 3, noise=NOISY)
    assert adaptation.model is model


@pytest.mark.long
def test_slip_that_looks_like_a_change_once_in_a_quarter_of_an_hour_does_no_harm():
    """Two seconds in which slip happens to lie far off its mean."""
    adaptation = OnlineAdaptation(noisy_model(0.1))
    given = go(adaptation, DifferentialDrive(0.1, seed=3), 10_000, 3, noise=NOISY)
    assert len(given) <= 4
    ratios = errors(adaptation.model, 0.1, 1.0) / errors(noisy_model(0.1), 0.1, 1.0)
    assert ratios.max() < 1.05


def test_a_pose_that_does_not_follow_the_one_before_shares_no_noise_with_it():
    """Somebody carried the robot, or nobody knew for a period what it was told."""
    adaptation, random = OnlineAdaptation(noisy_model()), np.random.default_rng(1)
    plant, x = DifferentialDrive(), np.zeros(3)
    for _ in range(20):
        after = plant.step(x, (0.4, 0.2), DT)
        seen = [pose + random.normal(size=3) * NOISY for pose in (x, after)]
        adaptation.update(seen[0], (0.4, 0.2), seen[1])
        np.testing.assert_array_equal(adaptation.state.earlier[2:4], (seen[1] - seen[0])[:2])
        x = after


def test_whitening_leaves_no_trace_of_a_pose_in_the_next_step():
    random, n, floor = np.random.default_rng(0), 100_000, RESTLESS * USUAL[0] * DT
    noise = np.zeros((3, 3, 3))
    noise[0, 0, 0] = 2 * 0.005**2
    (carried, at_heading), (white, _) = whitening(noise, DT)
    pose = random.normal(size=n + 1) * 0.005
    steps = np.diff(pose) + random.normal(size=n) * floor
    fading, found = 0.0, np.empty(n)
    for k, step in enumerate(steps):
        fading = found[k] = step + carried * fading
    assert found.var() == pytest.approx(white * steps.var(), rel=0.03)
    assert all(abs(np.corrcoef(found[:-lag], found[lag:])[0, 1]) < 0.02 for lag in (1, 2, 5))
    assert np.corrcoef(steps[:-1], steps[1:])[0, 1] < -0.2
    # exact poses need none of it
    assert at_heading < 1e-6


@pytest.mark.parametrize("steps", [8000, pytest.param(100_000, marks=pytest.mark.long)])
def test_standing_still_changes_nothing(steps):
    adaptation = OnlineAdaptation(model_of(0.05))
    random = np.random.default_rng(0)
    go(adaptation, DifferentialDrive(0.05, seed=1), 200, 0)
    sums, slow, used = (
        adaptation.state.recent.copy(),
        adaptation.state.slow.copy(),
        adaptation.counts.used,
    )
    poses = np.array([0.3, 0.2, 0.1]) + random.normal(size=(steps + 1, 3)) * (0.005, 0.005, 0.02)
    still = np.zeros(2)
    assert not any(adaptation.update(a, still, b) for a, b in zip(poses, poses[1:], strict=False))
    assert adaptation.counts.still == steps and adaptation.counts.used == used
    np.testing.assert_array_equal(adaptation.state.recent, sums)
    np.testing.assert_array_equal(adaptation.state.slow, slow)


def test_a_straight_line_does_not_unlearn_turning():
    adaptation = OnlineAdaptation(model_of(0.05))
    straight = np.tile([0.5, 0.0], (3000, 1))
    go(
        adaptation,
        DifferentialDrive(0.2, seed=2),
        3000,
        1,
        commands=straight,
        noise=(0.002, 0.002, 0.01),
    )
    # the slip ahead and sideways is learned; of the turns nothing was seen
    assert adaptation.gains.ahead == pytest.approx(1.2 / 1.05, abs=0.05)
    assert adaptation.gains.turn == pytest.approx(1.0, abs=0.02)
    go(adaptation, DifferentialDrive(0.2, seed=3), 150, 2)
    assert adaptation.gains.turn == pytest.approx(1.2 / 1.05, abs=0.1)


def test_turning_on_the_spot_does_not_unlearn_driving():
    adaptation = OnlineAdaptation(model_of(0.05))
    go(
        adaptation,
        DifferentialDrive(0.05, seed=2, turn_gain=0.6),
        1000,
        1,
        commands=np.tile([0.0, 0.6], (1000, 1)),
    )
    assert adaptation.gains.turn == pytest.approx(0.6, abs=0.03)
    assert adaptation.gains.ahead == pytest.approx(
        1.0, abs=0.02
    ) and adaptation.gains.left == pytest.approx(0.0, abs=0.02)


def test_a_robot_that_pulls_to_one_side():
    random, adaptation = np.random.default_rng(0), OnlineAdaptation(nominal_unicycle(DT))
    x = np.zeros(3)
    for _ in range(100):
        u = random.uniform(-1, 1, 2) * U_MAX
        after = nominal_unicycle(DT).predict(x, u + (0.0, 0.2 * u[0]))
        adaptation.update(x, u, after)
        x = after
    np.testing.assert_allclose(adaptation.gains, Gains(pull=0.2), atol=1e-3)


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
    assert adaptation.update(np.zeros(3), np.array([np.nan, 0.0]), np.zeros(3)) is None


def test_headings_may_wrap():
    adaptation, other = OnlineAdaptation(model_of(0.0)), OnlineAdaptation(model_of(0.0))
    random, x, plant = (
        np.random.default_rng(0),
        np.array([0.0, 0.0, 3.1]),
        DifferentialDrive(turn_gain=0.7),
    )
    for _ in range(60):
        u = random.uniform(-1, 1, 2) * U_MAX
        after = plant.step(x, u, DT)
        adaptation.update(x, u, after)
        other.update(x, u, (after[0], after[1], np.remainder(after[2] + np.pi, 2 * np.pi) - np.pi))
        x = after
    assert adaptation.counts == other.counts and adaptation.counts.models > 0
    np.testing.assert_allclose(adaptation.gains, other.gains, atol=1e-9)


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
    np.testing.assert_allclose(adaptation.state.slow, turned.state.slow, rtol=1e-6)


def test_the_result_is_a_model_that_can_be_saved(tmp_path):
    adaptation = OnlineAdaptation(model_of(0.05))
    model = go(adaptation, DifferentialDrive(0.05, seed=1, turn_gain=0.6), 100, 0)[-1]
    model.save(tmp_path / "adapted.npz")
    loaded = KoopmanModel.load(tmp_path / "adapted.npz")
    assert loaded.info["adaptation"]["turn"] == adaptation.gains.turn
    x, u = np.array([0.1, 0.2, 0.3]), np.array([0.5, -0.4])
    np.testing.assert_array_equal(loaded.predict(x, u), model.predict(x, u))
    # and it is where a further drive can begin
    again = OnlineAdaptation(loaded)
    assert not go(again, DifferentialDrive(0.05, seed=6, turn_gain=0.6), 300, 5)


def test_gains_act_as_named():
    base = nominal_unicycle(DT)
    adaptation = OnlineAdaptation(base)
    go(adaptation, DifferentialDrive(), 30, 0)
    model = adaptation._give(Gains(ahead=1.2, left=-0.1, turn=0.5, pull=0.3))
    # no turn while it is driven, so that the displacement can be read off
    end = model.with_dt(1e-4).predict(np.zeros(3), np.array([1.0, 1.0])) / 1e-4
    np.testing.assert_allclose(end, [1.2, -0.1, 0.8], atol=1e-3)
    assert adaptation._give(Gains(ahead=5.0)) is None and adaptation._give(Gains(turn=-1.0)) is None
    adaptation.reset()
    assert (
        adaptation.model is base and adaptation.gains == Gains() and adaptation.counts.models == 0
    )


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


def test_bad_arguments():
    data = generate_dataset(DifferentialDrive(0.05), episodes=10, steps=50, dt=DT)
    with pytest.raises(ModelError, match="needs a continuous model"):
        OnlineAdaptation(fit(data, method="edmdc"))
    with pytest.raises(ProblemError, match="window < memory"):
        OnlineAdaptation(nominal_unicycle(DT), AdaptationOptions(window=5.0, memory=5.0))
    adaptation = OnlineAdaptation(nominal_unicycle(DT))
    with pytest.raises(ValueError, match="expected x"):
        adaptation.update((0.0, 0.0), (0.0, 0.0), (0.0, 0.0, 0.0))
    slow = OnlineAdaptation(fit(data, InputHistoryDictionary(UnicycleDictionary(), lags=(0, 1))))
    with pytest.raises(ValueError, match="history"):
        slow.update(np.zeros(3), np.zeros(2), np.zeros(3), np.zeros((3, 2)))


class Mirrored(DifferentialDrive):
    """A robot that turns the other way round: the log of another robot, or a sign in its wiring."""

    def step(self, x, u, dt):
        return super().step(x, (u[0], -u[1]), dt)


def test_a_mirrored_robot_is_told_within_seconds():
    adaptation = OnlineAdaptation(model_of(0.05))
    go(adaptation, Mirrored(0.05, seed=3), 80, 1)
    assert "turns -" in adaptation.wrong_model
    assert adaptation.model is adaptation.base
    adaptation.reset()
    assert not adaptation.wrong_model


@pytest.mark.parametrize("slip", [0.0, 0.05, 0.2])
def test_no_floor_is_taken_for_another_robot(slip):
    for seed in range(2):
        adaptation = OnlineAdaptation(model_of(0.05))
        plant = DifferentialDrive(slip, seed=seed, turn_gain=0.5)
        go(adaptation, plant, 600, seed, noise=(0.005, 0.005, 0.02))
        assert not adaptation.wrong_model and adaptation.counts.models


def test_an_adapted_model_that_predicts_worse_gives_way_to_the_learned_one():
    adaptation = OnlineAdaptation(model_of(0.05))
    state = adaptation.state
    state.gains = Gains(turn=0.6)  # of a floor that is gone, and too little to raise an alarm
    adaptation.options = replace(adaptation.options, window_alarm=1e9, memory_alarm=1e9)
    go(adaptation, DifferentialDrive(0.05, seed=3), 200, 1)
    assert adaptation.gains == Gains() and adaptation.model is adaptation.base


def test_its_state_copies_and_pickles_to_the_last_bit():
    adaptation = OnlineAdaptation(model_of(0.05))
    plant = DifferentialDrive(0.2, seed=3, turn_gain=0.7)
    go(adaptation, plant, 45, 1)
    other = pickle.loads(pickle.dumps(adaptation))
    for each in (adaptation, other):
        go(each, DifferentialDrive(0.2, seed=4, turn_gain=0.7), 200, 2)
    assert adaptation.gains == other.gains and adaptation.counts == other.counts
    np.testing.assert_array_equal(adaptation.state.raw, other.state.raw)


def test_the_same_robot_scaled_learns_the_same_gains():
    scale = Scale(4.0, 2.0)
    one, large = (
        OnlineAdaptation(nominal_unicycle(DT)),
        OnlineAdaptation(nominal_unicycle(DT * scale.time), scale=scale),
    )
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
