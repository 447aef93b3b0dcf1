import json
from dataclasses import replace

import numpy as np
import pytest

from kmpc_lite import (
    DifferentialDrive,
    InputHistoryDictionary,
    NavigationProblem,
    UnicycleDictionary,
    fit,
    generate_dataset,
    nominal_unicycle,
)
from kmpc_lite.control.margins.quantiles import default_quantile, model_quantile
from kmpc_lite.control.margins.tightening import (
    HEADWAY,
    LONGEST_HEADWAY,
    RESERVE,
    STRANGE,
    Tightening,
)
from kmpc_lite.errors import ProblemError
from kmpc_lite.learn.calibration import with_quantiles
from kmpc_lite.model.koopman import KoopmanModel, NoiseModel
from kmpc_lite.model.tube import FLOOR, FORWARD, LATERAL, MEMORY, STILL, TURN

PROBLEM = NavigationProblem()


def slipping(slip, seed=0):
    data = generate_dataset(
        DifferentialDrive(slip, seed=seed), episodes=60, steps=400, dt=0.1, seed=seed + 1
    )
    train, held_out = data.split(0.5)
    return with_quantiles(fit(train), held_out)


@pytest.fixture(scope="module")
def model():
    return slipping(0.1)


def plan(model, v=0.6, omega=0.3, n=20, heading=0.4):
    inputs = np.tile([v, omega], (n, 1))
    states = model.rollout((0.2, -0.1, heading), inputs)
    return model.linearize(states[:-1], inputs), states, inputs


def of_noise(model, **options):
    """Margins that come from the learned noise alone."""
    return Tightening(model, PROBLEM, headway=0.0, **options)


def directions(n, slots, seed=0):
    angle = np.random.default_rng(seed).uniform(-np.pi, np.pi, (n, slots))
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def naive_covariance(model, lin, states, inputs, stage):
    """Position covariance of one stage, step by step, straight from the definitions."""
    s0, s1, s2 = model.noise_model.coefficients
    total = np.zeros((3, 3))
    for k in range(max(0, stage - MEMORY), stage):
        c, s = np.cos(states[k, 2]), np.sin(states[k, 2])
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        drift = np.array([-s, c]) @ lin.A[k][:2, 2]
        gain = LATERAL * drift / (drift**2 + STILL**2)
        feedback = turn @ np.array([[-FORWARD, 0, 0], [0, 0, 0], [0, -gain, -TURN]]) @ turn.T
        step = lin.A[k] + feedback
        v, omega = inputs[k]
        total = step @ total @ step.T + turn @ (s1 * v**2 + s2 * omega**2) @ turn.T
    c, s = np.cos(states[stage - 1, 2]), np.sin(states[stage - 1, 2])
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return (total + turn @ (s0 + FLOOR**2 * np.eye(3)) @ turn.T)[:2, :2]


@pytest.mark.parametrize("n", [1, 3, 20])
def test_equals_a_naive_loop(model, n):
    random = np.random.default_rng(3)
    inputs = random.uniform(-0.6, 0.6, (n, 2))
    states = model.rollout((0.2, -0.1, 0.4), inputs)
    lin = model.linearize(states[:-1], inputs)
    normals = directions(n, 6)
    tightening = Tightening(model, replace(PROBLEM, horizon=n), risk=0.02, headway=0.0)
    margins = tightening.margins(lin, states, inputs, normals)
    assert margins.shape == (n, 6)
    lengths = np.hypot(*np.diff(states[:, :2], axis=0).T)
    turns = np.abs(np.diff(states[:, 2]))
    for k in range(1, n + 1):
        covariance = naive_covariance(model, lin, states, inputs, k)
        around = slice(k - 1, k + 1)
        bulge = (lengths * turns / 8)[around].max()
        chord = (
            np.sqrt((PROBLEM.robot_radius + bulge) ** 2 + lengths[around].max() ** 2 / 4)
            - PROBLEM.robot_radius
        )
        for j in range(6):
            expected = (
                tightening.quantile * np.sqrt(normals[k - 1, j] @ covariance @ normals[k - 1, j])
                + chord
                + RESERVE
            )
            assert margins[k - 1, j] == pytest.approx(expected, rel=1e-9)


def test_grows_with_risk_and_speed(model):
    normals = directions(20, 6)
    by_risk = [
        of_noise(model, risk=r).margins(*plan(model), normals)
        for r in (0.3, 0.05, 0.01, 0.001, 1e-5)
    ]
    assert all((b > a).all() for a, b in zip(by_risk, by_risk[1:], strict=False))
    by_speed = [
        of_noise(model, reserve=0.0).margins(*plan(model, v, 0.0), normals)
        for v in (0.0, 0.1, 0.3, 0.6)
    ]
    assert all((b > a).all() for a, b in zip(by_speed, by_speed[1:], strict=False))
    assert by_speed[0].max() < 0.3 * by_speed[-1].min()


def test_a_shaky_floor_needs_more_room():
    margins = [
        of_noise(m).margins(*plan(m), directions(20, 4)).mean()
        for m in (slipping(0.02), slipping(0.1), slipping(0.2))
    ]
    assert margins[0] < 0.5 * margins[1] < margins[2]


def test_every_plan_keeps_headway_whatever_its_model_promises():
    exact, normals = nominal_unicycle(0.1), directions(20, 3)
    fast, radii = (
        Tightening(exact, NavigationProblem(u_max=(2.0, 1.0))),
        np.array([0.3, 0.4, np.inf]),
    )
    for v, expected in (
        (0.0, 0.0),
        (0.1, 0.1 * HEADWAY),
        (-0.4, 0.4 * HEADWAY),
        (1.5, LONGEST_HEADWAY),
    ):
        for tightening in (Tightening(exact, PROBLEM), fast) if v <= 0.6 else (fast,):
            own = of_noise(exact).margins(*plan(exact, v), normals)
            np.testing.assert_allclose(tightening.margins(*plan(exact, v), normals), own + expected)
            per_circle = of_noise(exact).margins(*plan(exact, v), normals, radii)
            np.testing.assert_allclose(
                tightening.margins(*plan(exact, v), normals, radii), per_circle + expected
            )


def test_noise_that_needs_more_than_the_headway_is_not_given_more():
    shaky = slipping(0.2)
    own = of_noise(shaky).margins(*plan(shaky), directions(20, 6))
    exact = nominal_unicycle(0.1)
    least = Tightening(exact, PROBLEM).margins(*plan(exact), directions(20, 6)).max()
    wide = own > 1.1 * least
    assert wide.any()
    np.testing.assert_array_equal(
        Tightening(shaky, PROBLEM).margins(*plan(shaky), directions(20, 6))[wide], own[wide]
    )


def test_mirror_symmetric():
    noise = np.zeros((3, 3, 3))
    noise[1], noise[2] = np.diag([1e-4, 2e-4, 1e-5]), np.diag([0.0, 0.0, 1e-4])
    model = replace(nominal_unicycle(0.1), noise_model=NoiseModel(noise))
    tightening, normals = Tightening(model, PROBLEM), directions(20, 5)
    left = tightening.margins(*plan(model, 0.5, 0.4, heading=0.3), normals)
    right = tightening.margins(*plan(model, 0.5, -0.4, heading=-0.3), normals * (1.0, -1.0))
    np.testing.assert_allclose(left, right, rtol=1e-12)
    np.testing.assert_allclose(
        tightening.margins(*plan(model), -normals),
        tightening.margins(*plan(model), normals),
        rtol=1e-12,
    )


def test_turns_with_the_map(model):
    noise = replace(nominal_unicycle(0.1), noise_model=model.noise_model)
    turn, normals = 0.9, directions(20, 5)
    rotation = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    straight = Tightening(noise, PROBLEM).margins(*plan(noise, heading=0.0), normals)
    turned = Tightening(noise, PROBLEM).margins(*plan(noise, heading=turn), normals @ rotation)
    np.testing.assert_allclose(turned, straight, rtol=1e-9)


def test_without_noise_only_the_chord_counts():
    model = nominal_unicycle(0.1)
    lin, states, inputs = plan(model, 0.6, 0.0)
    margins = of_noise(model, reserve=0.0).margins(
        lin, states, inputs, directions(20, 3), np.array([0.3, 0.15, np.inf])
    )
    assert margins.shape == (20, 3)
    # a robot whose samples keep this distance touches the circle in the middle between them, and no
    # more
    for radius, margin in zip((0.3, 0.15), margins[0], strict=False):
        assert np.hypot(0.0, np.sqrt((radius + margin) ** 2 - 0.03**2)) == pytest.approx(radius)
    np.testing.assert_allclose(margins[:, 2], 0.0, atol=1e-6)


def test_an_arc_between_samples_stays_outside_the_circle():
    model = nominal_unicycle(0.1)
    radius, u = 0.25, np.array([0.6, -0.78])
    inputs = np.tile(u, (20, 1))
    states = model.rollout((0.0, 0.0, 0.0), inputs)
    lin = model.linearize(states[:-1], inputs)
    margin = of_noise(model, reserve=0.0).margins(
        lin, states, inputs, directions(20, 1), np.array([radius])
    )[4, 0]
    fine = model.with_dt(0.001).rollout(states[4], np.tile(u, (100, 1)))
    # a circle on the outer side, as near as the margin lets both samples be
    middle, chord = (states[4, :2] + states[5, :2]) / 2, states[5, :2] - states[4, :2]
    outward = np.array([-chord[1], chord[0]]) / np.hypot(*chord)
    half = np.hypot(*chord) / 2
    centre = middle + outward * np.sqrt((radius + margin) ** 2 - half**2)
    assert np.hypot(*(states[4, :2] - centre)) == pytest.approx(radius + margin)
    nearest = np.hypot(*(fine[:, :2] - centre).T).min()
    assert radius - 1e-5 <= nearest <= radius + 1e-3


@pytest.mark.parametrize(
    ("slip", "v", "omega"), [(0.05, 0.6, 0.0), (0.1, 0.6, 0.4), (0.2, 0.3, -0.2), (0.2, 0.6, 0.3)]
)
def test_deviations_under_feedback_stay_within_the_margins(slip, v, omega):
    """Drive the slipping plant many times with the assumed feedback, and count who leaves the tube."""
    model, risk, trials = slipping(slip), 0.05, 4000
    lin, states, inputs = plan(model, v, omega)
    tightening = Tightening(model, PROBLEM, risk=risk, reserve=0.0, headway=0.0)
    covariances = tightening.covariances(lin, states, inputs)
    closed = naive_feedback(lin, states)
    gains = np.linalg.pinv(lin.B) @ closed
    plant = DifferentialDrive(slip, seed=99)
    x = np.tile(states[0], (trials, 1))
    normals = directions(20, 6, seed=5)
    margins = tightening.margins(lin, states, inputs, normals)
    worst, outside = np.zeros(trials), np.zeros((20, 6))
    for k in range(20):
        u = inputs[k] + (x - states[k]) @ gains[k].T
        x = plant.step(x, u, 0.1)
        error = (x - states[k + 1])[:, :2]
        outside[k] = (error @ normals[k].T > margins[k]).mean(axis=0)
        if k < MEMORY:
            score = np.einsum("ni,ni->n", error, np.linalg.solve(covariances[k], error.T).T)
            worst = np.maximum(worst, np.sqrt(score))
    assert outside.max() <= risk
    assert (worst > tightening.quantile).mean() <= risk + 3 * np.sqrt(risk / trials)


def naive_feedback(lin, states):
    out = []
    for k in range(len(lin.A)):
        c, s = np.cos(states[k, 2]), np.sin(states[k, 2])
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        drift = np.array([-s, c]) @ lin.A[k][:2, 2]
        out.append(
            turn
            @ np.array(
                [[-FORWARD, 0, 0], [0, 0, 0], [0, -LATERAL * drift / (drift**2 + STILL**2), -TURN]]
            )
            @ turn.T
        )
    return np.array(out)


def test_quantiles_survive_a_file(model, tmp_path):
    model.save(tmp_path / "m.npz")
    loaded = KoopmanModel.load(tmp_path / "m.npz")
    assert (
        Tightening(loaded, PROBLEM, risk=0.013).quantile
        == Tightening(model, PROBLEM, risk=0.013).quantile
    )
    json.dumps(dict(model.info))


def test_quantile_lookup():
    table = {"noise_quantiles": {"risks": [0.1, 0.01], "quantiles": [3.0, 5.0]}}
    assert model_quantile(table, 0.1) == pytest.approx(3.0)
    assert model_quantile(table, 0.1**1.5) == pytest.approx(4.0)
    assert model_quantile(table, 0.001) == pytest.approx(7.0)
    assert model_quantile(table, 0.5) == pytest.approx(3.0)
    assert model_quantile({}, 0.01) == default_quantile(0.01)


def test_default_quantile_covers_both_tails():
    random = np.random.default_rng(0)
    normal = np.hypot(*random.normal(size=(2, 100_000)))
    exponential = np.abs(random.exponential(size=(2, 100_000)) - 1.0).max(axis=0)
    for risk in (0.1, 0.01, 0.001):
        limit = risk + 3 * np.sqrt(risk / 100_000)
        assert (normal > default_quantile(risk)).mean() <= limit
        assert (exponential > default_quantile(risk)).mean() <= limit


@pytest.mark.parametrize(
    "table",
    [
        {"risks": [0.1]},
        {"risks": [0.1], "quantiles": [1.0]},
        {"risks": [0.1, 0.2], "quantiles": [1, 2]},
        {"risks": "x", "quantiles": 1},
        3,
    ],
)
def test_damaged_table(model, table):
    with pytest.raises(ProblemError, match="damaged"):
        Tightening(replace(model, info={"noise_quantiles": table}), PROBLEM)


@pytest.mark.parametrize(
    "options",
    [
        {"risk": 0.0},
        {"risk": 1.0},
        {"risk": np.nan},
        {"quantile": -1.0},
        {"quantile": np.nan},
        {"reserve": -0.1},
        {"headway": np.nan},
    ],
)
def test_bad_options(model, options):
    with pytest.raises(ProblemError, match="expected"):
        Tightening(model, PROBLEM, **options)


def test_input_history_is_taken_without_feedback():
    data = generate_dataset(DifferentialDrive(0.1, seed=1), episodes=40, steps=200, dt=0.1, seed=2)
    model = fit(data, InputHistoryDictionary(UnicycleDictionary(), lags=(0, 1)))
    inputs = np.tile([0.5, 0.2], (20, 1))
    states = model.rollout((0, 0, 0), inputs)
    lin = model.linearize(states[:-1], inputs, np.zeros((20, 1, 2)))
    margins = of_noise(model).margins(lin, states, inputs, directions(20, 3))
    assert np.isfinite(margins).all() and margins[-1].min() > margins[0].max()


def test_update_takes_over_another_noise(model):
    lin, states, inputs = plan(model)
    tightening, normals = of_noise(model), directions(20, 3)
    before = tightening.margins(lin, states, inputs, normals)
    tightening.update(replace(model, noise_model=NoiseModel(4.0 * model.noise_model.coefficients)))
    after = tightening.margins(lin, states, inputs, normals)
    assert (after > 1.5 * before).all()


CIRCLES = np.array([[1.0, 0.0, 0.2, 0.0, 0.0]])


def test_speed_share_far_away_is_one(model):
    tightening = Tightening(model, PROBLEM)
    u = np.array([0.6, 0.2])
    assert tightening.speed_share(np.zeros(3), u, CIRCLES) == 1.0
    assert tightening.speed_share(np.zeros(3), u, CIRCLES[:0]) == 1.0


def test_speed_share_never_lets_the_slip_reach_an_obstacle():
    slip = 0.2
    model = slipping(slip)
    tightening, plant = Tightening(model, PROBLEM), DifferentialDrive(slip, seed=7)
    random = np.random.default_rng(8)
    touched, slowed = 0, 0
    for _ in range(2000):
        x = np.array([1.0 - 0.35 - random.uniform(0.002, 0.1), 0.0, random.uniform(-1.2, 1.2)])
        u = np.array([random.uniform(0.1, 0.6), random.uniform(-0.7, 0.7)])
        share = tightening.speed_share(x, u, CIRCLES)
        slowed += share < 1.0
        trace = plant.trace(x, share * u, 0.1, 8)
        touched += bool((np.hypot(trace[:, 0] - 1.0, trace[:, 1]) < 0.35).any())
    assert slowed > 1000
    assert touched <= 4


def test_speed_share_lets_a_touching_robot_get_free(model):
    tightening = Tightening(model, PROBLEM)
    x = np.array([0.66, 0.0, 0.0])
    back, ahead = np.array([-0.3, 0.0]), np.array([0.3, 0.0])
    assert tightening.speed_share(x, back, CIRCLES) >= 0.25
    assert tightening.speed_share(x, ahead, CIRCLES) == 0.0


def test_a_robot_that_drives_past_an_obstacle_is_not_taken_for_one_that_leaves_it():
    """A few mm beside it on a floor that pushes aside: what leads away by little may not be driven at a quarter of full speed."""
    tightening = Tightening(slipping(0.2), PROBLEM)
    u = np.array([0.6, 0.0])
    shares = [
        tightening.speed_share(np.array([1.0 - 0.352, 0.0, 0.5 * np.pi + turned]), u, CIRCLES)
        for turned in (0.02, 0.3, 0.5 * np.pi)
    ]
    assert shares[0] < 0.06 < shares[1] < 0.2 and shares[2] >= 0.25


def test_a_robot_that_does_not_know_its_floor_is_wary_of_each_command():
    model = nominal_unicycle(0.1)
    tightening = Tightening(model, PROBLEM)
    sure = tightening.step_margin(0.6, 0.0)
    # pushed by a quarter of its way, three times in a row
    for _ in range(3):
        tightening.observe(np.array([0.0, -0.015, 0.0]), 0.0, np.array([0.6, 0.0]))
    assert tightening.inflation > STRANGE[0] and sure < 0.01
    assert tightening.step_margin(0.6, 0.0) > 5.0 * STRANGE[1] * 0.06
    beside, u = np.array([1.0 - 0.38, 0.0, 0.5 * np.pi]), np.array([0.6, 0.0])
    share = tightening.speed_share(beside, u, CIRCLES)
    assert share < 0.5 < Tightening(model, PROBLEM).speed_share(beside, u, CIRCLES)
    # a model that knows this floor needs no more than it knows
    truth = slipping(0.2)
    tightening.update(truth)
    assert tightening.step_margin(0.6, 0.0) == pytest.approx(
        Tightening(truth, PROBLEM).step_margin(0.6, 0.0)
    )


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_floor_that_pushes_to_one_side_is_noticed_among_noisy_poses(way):
    """Pushes of 10 mm to the right, backwards to the left, and poses that are 5 mm wrong: no error is large, their sum is."""
    noise = NoiseModel(np.array([np.diag([5e-5, 5e-5, 8e-4]), np.zeros((3, 3)), np.zeros((3, 3))]))
    model, random, u = (
        replace(nominal_unicycle(0.1), noise_model=noise),
        np.random.default_rng(0),
        np.array([0.5 * way, 0.0]),
    )
    calm, pushed = Tightening(model, PROBLEM), Tightening(model, PROBLEM)
    sure, wary = calm.step_margin(0.5, 0.0), 0
    for errors in np.diff(random.normal(size=(1001, 2)) * 0.005, axis=0):
        calm.observe(np.append(errors, 0.0), 0.0, u)
        wary += calm.step_margin(0.5, 0.0) > 5.0 * sure
    assert wary < 60
    for errors in np.diff(random.normal(size=(9, 2)) * 0.005, axis=0):
        pushed.observe(np.append(errors + (0.0, -0.010 * way), 0.0), 0.0, u)
    assert pushed.inflation < STRANGE[0] and pushed.step_margin(0.5, 0.0) > 5.0 * sure
    pushed.reset()
    assert pushed.step_margin(0.5, 0.0) == sure


def test_a_model_that_was_learned_while_driving_makes_its_commands_safe_for_rarer_errors():
    truth = slipping(0.2)
    known, new = (
        Tightening(m, PROBLEM)
        for m in (truth, replace(truth, info={**truth.info, "adaptation": {}}))
    )
    assert new.quantile == known.quantile
    assert 1.15 < new.step_margin(0.6, 0.0) / known.step_margin(0.6, 0.0) < 1.5


def test_speed_share_keeps_a_robot_without_slip_outside_on_any_curve():
    model = nominal_unicycle(0.1)
    tightening, random, slowed = Tightening(model, PROBLEM), np.random.default_rng(9), 0
    for _ in range(2000):
        x = np.array([1.0 - 0.351 - random.uniform(0.0, 0.06), 0.0, random.uniform(-1.6, 1.6)])
        u = np.array([random.uniform(0.1, 0.6), random.uniform(-0.78, 0.78)])
        share = tightening.speed_share(x, u, CIRCLES)
        slowed += share < 1.0
        trace = DifferentialDrive().trace(x, share * u, 0.1, 8)
        assert np.hypot(trace[:, 0] - 1.0, trace[:, 1]).min() >= 0.35 - 1e-9
    assert slowed > 500


def test_speed_share_is_not_deceived_by_a_curve_that_ends_farther_away():
    """Backwards along a circle, a millimetre from it: the end of the period is farther, the way there is not."""
    model = nominal_unicycle(0.1)
    circles = np.array([[0.0, 0.0, 0.2, 0.0, 0.0]])
    tightening, random = Tightening(model, PROBLEM), np.random.default_rng(3)
    for _ in range(2000):
        x = np.array([0.351, 0.0, random.uniform(-np.pi, np.pi)])
        u = np.array([random.uniform(-0.6, 0.6), random.uniform(-0.78, 0.78)])
        trace = DifferentialDrive().trace(x, tightening.speed_share(x, u, circles) * u, 0.1, 8)
        assert np.hypot(trace[:, 0], trace[:, 1]).min() >= 0.35 - 1e-9


def drive_and_observe(tightening, model, plant, steps, seed=0):
    random, x, found = np.random.default_rng(seed), np.zeros(3), []
    for _ in range(steps):
        u = random.uniform(-0.6, 0.6, 2)
        after = plant.step(x, u, 0.1)
        tightening.observe(after - model.predict(x, u), x[2], u)
        found.append(tightening.inflation)
        x = np.append(random.uniform(-1.0, 1.0, 2), after[2] % 1.0)
    return np.array(found)


@pytest.mark.parametrize("slip", [0.0, 0.05, 0.2])
def test_what_was_expected_widens_nothing(slip):
    model = slipping(slip)
    found = drive_and_observe(
        Tightening(model, PROBLEM), model, DifferentialDrive(slip, seed=3), 4000
    )
    assert (found == 1.0).mean() > 0.85
    assert np.quantile(found, 0.99) < 2.5


def test_a_floor_that_slips_more_widens_the_margins_at_once():
    model = slipping(0.02)
    tightening = of_noise(model)
    lin, states, inputs = plan(model)
    calm = tightening.margins(lin, states, inputs, directions(20, 3))
    found = drive_and_observe(tightening, model, DifferentialDrive(0.2, seed=3), 200)
    assert found[5] > 2.5
    # mean and scatter of the slip are ten times the learned ones
    assert 6.0 < np.median(found[20:]) < 16.0
    assert (tightening.margins(lin, states, inputs, directions(20, 3)) > 2.0 * calm).all()
    x, u = np.array([0.58, 0.0, 0.0]), np.array([0.6, 0.0])
    alarmed = tightening.speed_share(x, u, CIRCLES)
    found = drive_and_observe(tightening, model, DifferentialDrive(0.02, seed=4), 100)
    assert found[60:].max() < 3.0
    tightening.reset()
    assert tightening.inflation == 1.0
    assert tightening.speed_share(x, u, CIRCLES) > alarmed


@pytest.mark.parametrize("known", [True, False])
def test_even_a_model_without_noise_gets_room_on_a_slipping_floor(known):
    model = slipping(0.0) if known else nominal_unicycle(0.1)
    tightening = Tightening(model, PROBLEM)
    drive_and_observe(tightening, model, DifferentialDrive(0.2, seed=3), 50)
    truth = slipping(0.2)
    lin, states, inputs = plan(model)
    felt = np.sqrt(np.linalg.eigvalsh(tightening.covariances(lin, states, inputs)).mean())
    expected = np.sqrt(
        np.linalg.eigvalsh(Tightening(truth, PROBLEM).covariances(*plan(truth))).mean()
    )
    assert 0.7 * expected < felt < 3.0 * expected
    # a model that expects this slip is not surprised by it
    tightening.update(truth)
    assert tightening.inflation < 2.0


def test_a_robot_that_turns_less_than_it_is_told_widens_the_margins_at_once(model):
    tightening = of_noise(model)
    lin, states, inputs = plan(model)
    calm = tightening.margins(lin, states, inputs, directions(20, 3))
    for _ in range(4):
        tightening.observe(np.array([0.0, 0.0, -0.03]), 0.0, np.array([0.3, 0.75]))
    assert tightening.inflation > 2.0
    assert (tightening.margins(lin, states, inputs, directions(20, 3))[5:] > 1.5 * calm[5:]).all()
    # a whole turn is no error
    fresh = Tightening(model, PROBLEM)
    fresh.observe(np.array([0.0, 0.0, 2 * np.pi]), 0.0, np.array([0.3, 0.75]))
    assert fresh.inflation == 1.0


def test_standing_and_broken_poses_widen_nothing(model):
    tightening = Tightening(model, PROBLEM)
    tightening.observe(np.array([0.1, 0.1, 0.0]), 0.0, np.zeros(2))
    tightening.observe(np.array([np.nan, 0.1, 0.0]), 0.0, np.array([0.5, 0.0]))
    tightening.observe(np.array([np.inf, 0.1, 0.0]), 0.0, np.array([0.5, 0.0]))
    tightening.observe(np.array([0.1, 0.1, 0.0]), 0.0, np.array([np.nan, 0.0]))
    assert tightening.inflation == 1.0
    tightening.observe(np.array([1e6, 0.1, 0.0]), 0.0, np.array([0.5, 0.0]))
    assert tightening.inflation < 10.0


@pytest.mark.parametrize("history", [0, 3])
@pytest.mark.parametrize("inflation", [1.0, 3.0])
def test_no_plan_within_the_bounds_asks_for_more_than_the_widest_margin(history, inflation):
    problem = NavigationProblem()
    noise = NoiseModel(
        np.array(
            [np.diag([1e-5, 1e-5, 1e-4]), np.diag([2e-4, 5e-5, 4e-4]), np.diag([1e-5, 4e-5, 2e-4])]
        )
    )
    base = nominal_unicycle(0.1)
    if history:
        data = generate_dataset(
            DifferentialDrive(0.1, seed=1), episodes=20, steps=100, dt=0.1, seed=3
        )
        base = fit(data, InputHistoryDictionary(UnicycleDictionary(), tuple(range(history + 1))))
    model = replace(base, noise_model=noise)
    tightening = Tightening(model, problem)
    tightening._inflate(inflation)
    random, most = np.random.default_rng(4), 0.0
    for _ in range(40):
        inputs = (
            random.uniform(problem.u_min, problem.u_max, (20, 2))
            if random.random() < 0.5
            else np.tile((0.6, 0.0), (20, 1))
        )
        states = model.rollout(random.uniform(-1, 1, 3), inputs)
        past = np.zeros((20, history, 2)) if history else None
        margins = tightening.margins(
            model.linearize(states[:-1], inputs, past), states, inputs, directions(20, 8)
        )
        most = max(most, float(margins.max()))
    # it is no wild guess either: what is far is often enough farther
    assert 0.3 * tightening.widest < most <= tightening.widest


def test_headway_gives_way_to_a_narrow_passage():
    model, problem = nominal_unicycle(0.1), NavigationProblem()
    tightening = Tightening(model, problem)
    fast = plan(model)
    roomy = tightening.margins(*fast, directions(20, 4))
    tightening.passage = 0.03
    narrow = tightening.margins(*fast, directions(20, 4))
    np.testing.assert_allclose(roomy - narrow, LONGEST_HEADWAY - 0.03, atol=1e-12)
    tightening.reset()
    np.testing.assert_allclose(tightening.margins(*fast, directions(20, 4)), roomy)
