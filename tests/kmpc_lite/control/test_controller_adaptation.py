"""The controller corrects its model while driving.

Where the floor contradicts it, and nowhere else.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from wary import covariances

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab import drive
from kmpc_lab.sim.maps import random_map
from kmpc_lite.adaptation.online import OnlineAdaptation
from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.control.estimate.innovation import InnovationState
from kmpc_lite.control.options import MarginOptions
from kmpc_lite.scenario.values import Floor

DT = 0.1
NOISE = (0.005, 0.005, 0.02)


@pytest.fixture(scope="module")
def knowing() -> dict[float, kl.KoopmanModel]:
    """Models by the slip that they were learned at, with margins from drives of their own."""

    def learn(slip: float) -> kl.KoopmanModel:
        data = kmpc_lab.generate_dataset(
            kmpc_lab.DifferentialDrive(slip, seed=3), episodes=120, steps=200, seed=4
        )
        fitted, held = data.split(0.5)
        return kl.with_quantiles(kl.fit(fitted), held)

    return {slip: learn(slip) for slip in (0.0, 0.05, 0.2)}


def test_it_runs_where_there_are_margins_and_the_model_can_be_adapted(
    learned: kl.KoopmanModel, learned_edmdc: kl.KoopmanModel, lagging: kl.KoopmanModel
) -> None:
    for model in (learned, lagging):
        assert isinstance(kl.Controller(model).adaptation, OnlineAdaptation)
        assert kl.Controller(model, adaptation=False).adaptation is None
        assert kl.Controller(model, tightening=None).adaptation is None
        assert kl.Controller(model, tightening=None, adaptation=True).adaptation is not None
        own = OnlineAdaptation(model, AdaptationOptions(window=3.0))
        assert kl.Controller(model, adaptation=own).adaptation is own
    assert kl.Controller(learned_edmdc).adaptation is None
    with pytest.raises(kl.ModelError, match="continuous"):
        kl.Controller(learned_edmdc, adaptation=True)
    with pytest.raises(kl.ProblemError, match="another model"):
        kl.Controller(learned, adaptation=OnlineAdaptation(lagging))


def test_it_is_made_for_a_robot_of_the_controllers_size_and_speed(learned: kl.KoopmanModel) -> None:
    large = kl.NavigationProblem(robot_radius=0.6)
    own = OnlineAdaptation(learned, scale=large.scale)
    assert kl.Controller(learned, large, adaptation=own).adaptation is own
    with pytest.raises(kl.ProblemError, match="another robot: expected its units .*length=4"):
        kl.Controller(learned, large, adaptation=OnlineAdaptation(learned))


@pytest.mark.parametrize("lag", [False, True])
def test_it_sees_what_was_measured_and_what_was_sent(
    learned: kl.KoopmanModel, lagging: kl.KoopmanModel, lag: bool
) -> None:
    class Listening(OnlineAdaptation):
        def update(self, x, u, x_next, history=None):  # type: ignore[no-untyped-def]
            heard.append((np.array(x), np.array(u), np.array(x_next), np.array(history)))
            return super().update(x, u, x_next, history)

    model, heard = lagging if lag else learned, []
    controller = kl.Controller(model, adaptation=Listening(model))
    poses, commands, x, plant = (
        [],
        [],
        np.array([0.0, 0.0, 2 * np.pi]),
        kmpc_lab.DifferentialDrive(0.05, seed=2),
    )
    for k in range(25):
        poses.append(x.copy())
        # a pose that is none makes a fallback, whose command counts too; at the goal the robot
        # holds
        goal = x.copy() if k > 20 else (1.5, 1.0, 0.5)
        plan = controller.step(
            np.full(3, np.nan) if k == 8 else x, goal, [kl.Circle(0.7, 0.2, 0.1)]
        )
        commands.append(plan.command.copy())
        x = plant.step(x, plan.command, DT)
    past = np.vstack([np.zeros((model.history, 2)), commands])
    # a pose that is none tells nothing of the periods beside it
    for k, told in zip([*range(7), *range(9, 24)], heard, strict=True):
        before, command, after, history = told
        np.testing.assert_array_equal(before, poses[k])
        np.testing.assert_array_equal(after, poses[k + 1])
        np.testing.assert_array_equal(command, commands[k])
        np.testing.assert_array_equal(history, past[k : k + model.history])


@pytest.mark.parametrize("tell", [True, False])
def test_what_a_gate_makes_of_commands_is_no_floor(learned: kl.KoopmanModel, tell: bool) -> None:
    # a gate that lets speeds grow by 0.02 m/s and 0.05 rad/s a period, on the floor that the model
    # was learned on
    controller, plant = kl.Controller(learned), kmpc_lab.DifferentialDrive(0.05, seed=2)
    x, acted, gains = np.zeros(3), np.zeros(2), []
    for k in range(120):
        goal = (1.5, 0.0, 0.0) if (k // 30) % 2 == 0 else (0.0, 0.5, 2.0)
        plan = controller.step(x, goal, sent=acted if tell and k else None)
        acted = acted + np.clip(plan.command - acted, (-0.02, -0.05), (0.02, 0.05))
        x = plant.step(x, acted, DT)
        assert controller.adaptation is not None
        gains.append(controller.adaptation.gains)
    far = max(abs(g.ahead - 1.0) for g in gains)
    assert far < 0.1 if tell else far > 0.2


def test_a_sent_command_of_another_shape_is_refused_and_nan_is_not_used(
    learned: kl.KoopmanModel, lagging: kl.KoopmanModel
) -> None:
    for model in (learned, lagging):
        controller = kl.Controller(model)
        first = controller.step((0, 0, 0), (1.0, 0.5, 0.0))
        with pytest.raises(ValueError, match="sent: expected shape"):
            controller.step((0, 0, 0), (1.0, 0.5, 0.0), sent=(0.1, 0.2, 0.3))
        past = controller.state.history.commands.copy()
        controller.step(first.states[1], (1.0, 0.5, 0.0), sent=(np.nan, 0.2))
        assert (
            np.isfinite(controller.state.history.commands).all()
            and (controller.state.history.commands[:-1] == past[1:]).all()
        )


def test_a_floor_that_changes_is_driven_with_a_model_of_it(
    knowing: dict[float, kl.KoopmanModel], tmp_path: object
) -> None:
    scenario = replace(random_map("open", 3), circles=(), floors=(Floor(1.0, 0.2, 0.6),))
    controller = kl.Controller(knowing[0.0], scenario.problem())
    run = drive(controller, scenario, settle=1.0)
    adaptation = controller.adaptation
    assert adaptation is not None and run.outcome.value == "reached"
    assert adaptation.gains.ahead == pytest.approx(1.2, abs=0.1)
    assert adaptation.gains.turn == pytest.approx(0.6 * 1.2, abs=0.12)
    # what the controller drives with, what is given out and what is saved are one model
    np.testing.assert_array_equal(controller.model.H, adaptation.model.H)
    adaptation.model.save(f"{tmp_path}/floor.npz")
    loaded = kl.KoopmanModel.load(f"{tmp_path}/floor.npz")
    assert loaded.info["noise_quantiles"] == knowing[0.0].info["noise_quantiles"]
    assert loaded.noise((0.5, 0.0))[0, 0] > 100 * knowing[0.0].noise((0.5, 0.0))[0, 0]
    # a reset controller is a new one
    controller.reset()
    assert adaptation.model is knowing[0.0] and not adaptation.counts.models
    np.testing.assert_array_equal(controller.model.H, knowing[0.0].H)
    again = drive(controller, scenario, settle=1.0)
    # but for what the solver remembers
    np.testing.assert_allclose(again.states, run.states, atol=1e-6)


@settings(max_examples=12, deadline=None)
@given(
    slip=st.sampled_from([0.0, 0.05, 0.2]),
    noise=st.sampled_from([(0.0, 0.0, 0.0), NOISE]),
    jumps=st.lists(
        st.tuples(st.integers(1, 79), st.floats(0.3, 3.0), st.floats(-np.pi, np.pi)), max_size=3
    ),
    seed=st.integers(0, 9999),
)
def test_a_good_model_is_never_made_worse(
    knowing: dict[float, kl.KoopmanModel],
    slip: float,
    noise: tuple[float, float, float],
    jumps: list[tuple[int, float, float]],
    seed: int,
) -> None:
    """A constant floor, noisy poses, and poses that jump (for good, as a localisation does) do
    not touch the model.
    """
    scenario = random_map("open", seed, slip)
    controller = kl.Controller(knowing[slip], scenario.problem())
    random, plant = np.random.default_rng(seed), kmpc_lab.DifferentialDrive(slip, seed=seed)
    x, shift = np.array(scenario.start), np.zeros(3)
    for k in range(80):
        for when, distance, bearing in jumps:
            if when == k:
                shift = shift + (distance * np.cos(bearing), distance * np.sin(bearing), 0.0)
        plan = controller.step(
            x + shift + random.normal(size=3) * noise, np.array(scenario.goal) + shift
        )
        x = plant.step(x, plan.command, DT)
    adaptation = controller.adaptation
    assert adaptation is not None and adaptation.counts.models == 0
    assert adaptation.model is knowing[slip]


def test_a_log_without_noise_does_not_make_margins_blind(knowing: dict[float, kl.KoopmanModel]):
    """Its calibrated quantile is next to nothing; of a floor that slips later it knows nothing."""
    assert knowing[0.0].info["noise_quantiles"]["quantiles"][-1] < 0.01
    controller = kl.Controller(knowing[0.0])
    inputs = np.tile((0.6, 0.0), (20, 1))
    states = knowing[0.0].rollout(np.zeros(3), inputs)
    lin, normals = knowing[0.0].linearize(states[:-1], inputs), np.tile((0.0, 1.0), (20, 1, 1))
    margins, state = controller.known.margins, InnovationState()
    assert margins is not None
    # what one period of an unknown floor may do is kept in any case
    kept = margins.of_plan(margins.calm, lin, states, inputs, normals)
    assert kept.min() > MarginOptions().headway * controller.problem.robot_radius

    def spread() -> float:
        return float(covariances(margins.felt(state), lin, states, inputs).max())

    def single() -> float:
        ahead = np.array((1.0, 0.0, 0.0))
        felt = margins.felt(state)
        return float(margins.of_commands(felt, inputs[:1], ahead)[0])

    calm, before = spread(), single()
    for _ in range(5):
        # pushed sideways by a slip of 0.2
        margins.expected_errors.judge(state, np.array([0.0, -0.012, 0.0]), 0.0, inputs[0], False)
    assert spread() > calm + 0.01**2
    assert single() > before + 0.1


def test_a_robot_that_lags_takes_the_same_risk(learned: kl.KoopmanModel, lagging: kl.KoopmanModel):
    def quantile(model: kl.KoopmanModel, **options: float) -> float:
        margins = kl.Controller(model, **options).known.margins  # type: ignore[arg-type]
        assert margins is not None
        return margins.noise.quantile

    assert quantile(learned) == quantile(lagging)
    assert quantile(learned, risk=0.1) == quantile(lagging, risk=0.1) < quantile(learned)


def turning(gain: float) -> kl.KoopmanModel:
    """Learned on a floor that lets so much of a turn happen."""
    log = kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(turn_gain=gain, seed=1), episodes=20, steps=60
    )
    return kl.fit(log)


def test_adaptation_corrects_the_model_that_took_another_ones_place() -> None:
    first, second = turning(1.0), turning(0.5)
    options = AdaptationOptions(window=3.0)
    controller = kl.Controller(first, adaptation=OnlineAdaptation(first, options))
    controller.update_model(second)
    assert controller.adaptation is not None
    assert controller.adaptation.base is second and controller.adaptation.options is options
    assert controller.state.adaptation is controller.adaptation.state
    x, plant, random = (
        np.zeros(3),
        kmpc_lab.DifferentialDrive(turn_gain=0.5),
        np.random.default_rng(0),
    )
    for k in range(120):
        if k % 40 == 0:
            goal = random.uniform((-1.5, -1.5, -3.0), (1.5, 1.5, 3.0))
        x = plant.step(x, controller.step(x, goal).command, DT)
    # the floor is as the second model says: there is nothing to correct
    assert controller.model is second and controller.adaptation.gains.turn == 1.0
    controller.reset()
    assert controller.model is second and controller.adaptation.base is second


def test_a_discrete_model_that_takes_anothers_place_is_not_corrected(
    learned: kl.KoopmanModel, learned_edmdc: kl.KoopmanModel
) -> None:
    controller = kl.Controller(learned)
    controller.update_model(learned_edmdc)
    assert controller.adaptation is None and controller.state.adaptation is None
    controller.step((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    controller.reset()
    assert controller.model is learned_edmdc
