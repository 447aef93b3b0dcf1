"""The largest share of a plan is driven from which the robot comes to rest clear."""

from typing import Any

import numpy as np
import pytest
from lagging_robot import lagging
from wary import slipping

import kmpc_lab as lab
import kmpc_lite as kl
from kmpc_lite.control.estimate.innovation import InnovationState
from kmpc_lite.control.margins import Margins
from kmpc_lite.control.options import StopOptions
from kmpc_lite.control.plan import Task
from kmpc_lite.control.safe_motion import SafeMotion, SafeMotions
from kmpc_lite.control.world.scene import Surroundings
from kmpc_lite.control.world.solids import Solids
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

PROBLEM = kl.NavigationProblem()
CART = kl.NavigationProblem(
    footprint=kl.Footprint.rectangle(0.8, 0.3), u_max=(0.6, 1.5), u_min=(-0.6, -1.5)
)
SLOW = kl.NavigationProblem(
    u_max=(1.5, 2.0), u_min=(-1.5, -2.0), du_max=(1.5, 5.0), deceleration=(1.5, 5.0)
)
NOMINAL = kl.nominal_unicycle(0.1)
NOTHING = np.empty((0, 7))


def rows(*circles: tuple[float, ...]) -> Array:
    """Things (M, 7) from x, y, radius and, of those that move, vx, vy and how fast they spread."""
    return np.array([(*c, *7 * (0.0,))[:7] for c in circles]).reshape(-1, 7)


def find(
    inputs: Array,
    around: Surroundings,
    model: KoopmanModel = NOMINAL,
    problem: kl.NavigationProblem = PROBLEM,
    last: Array | None = None,
    pose_error: float | None = None,
    **options: Any,
) -> SafeMotion:
    """What is driven of commands (N, 2), or of one (2,) that is held, by a robot at the origin."""
    inputs = np.tile(inputs, (20, 1)) if inputs.ndim == 1 else inputs
    last = inputs[0] if last is None else last
    past = np.tile(last, (model.history, 1))
    states = model.rollout(np.zeros(3), inputs, past)
    margins = Margins(model, problem)
    if pose_error is not None:
        margins.calm = margins.calm._replace(pose_error=pose_error)
    task = Task(model, past, last, around, margins, margins.calm)
    return SafeMotions(problem, StopOptions(**options)).find(states, inputs, task)


def to_rest(motion: SafeMotion, model: KoopmanModel, past: Array | None = None) -> Array:
    """Poses at ten moments a period until the robot stands: of a model without lag."""
    assert motion.commands is not None and not motion.commands[-1].any()
    x, poses = np.zeros(3), []
    for command in motion.commands:
        trace = lab.DifferentialDrive().trace(x, command, 0.1, 10)
        poses.append(trace)
        x = trace[-1]
    return np.concatenate(poses)


def test_far_from_everything_the_plan_is_driven_as_it_is() -> None:
    inputs = np.tile((0.6, 0.2), (20, 1))
    motion = find(inputs, Surroundings(rows((3.0, 0.0, 0.2))))
    assert motion.inputs is inputs and not motion.slowed
    assert motion.commands is not None and not motion.commands[-1].any()


def test_the_motion_stays_clear_until_the_robot_stands() -> None:
    random, seen = np.random.default_rng(3), set()
    for _ in range(150):
        angle, distance = random.uniform(-1.5, 1.5), random.uniform(0.36, 0.7)
        circle = distance * np.cos(angle), distance * np.sin(angle), 0.2
        command = np.array((random.uniform(-0.6, 0.6), random.uniform(-0.7, 0.7)))
        motion = find(command, Surroundings(rows(circle)))
        gaps = np.hypot(*(to_rest(motion, NOMINAL)[:, :2] - circle[:2]).T) - 0.35
        assert gaps.min() > -1e-9
        seen.add(motion.slowed)
    assert seen == {False, True}


def test_a_robot_that_lags_has_a_clear_motion_or_none_at_all() -> None:
    model, random = lagging(), np.random.default_rng(5)
    outcomes = {"clear": 0, "slowed": 0, "none": 0}
    for _ in range(150):
        angle, distance = random.uniform(-1.0, 1.0), random.uniform(0.4, 1.2)
        circle = distance * np.cos(angle), distance * np.sin(angle), 0.2
        past = np.tile((random.uniform(0.0, 0.6), 0.0), (4, 1))
        motion = find(np.array((0.6, 0.0)), Surroundings(rows(circle)), model, last=past[0])
        if motion.commands is None:
            outcomes["none"] += 1
            # not even zero from now on would have kept clear of it by much
            states = model.rollout(np.zeros(3), np.zeros((6, 2)), past)
            assert (np.hypot(*(states[:, :2] - circle[:2]).T) - 0.35).min() < 0.03
            continue
        outcomes["slowed" if motion.slowed else "clear"] += 1
        commands = np.concatenate([motion.commands, np.zeros((4, 2))])
        states = model.rollout(np.zeros(3), commands, past)
        assert (np.hypot(*(states[:, :2] - circle[:2]).T) - 0.35).min() >= 0.0
        np.testing.assert_allclose(states[-1], states[-2], atol=1e-9)
    assert min(outcomes.values()) >= 5, outcomes


@pytest.mark.parametrize("model", [NOMINAL, lagging()], ids=["at once", "lags"])
def test_a_standing_robot_may_always_stand_and_may_leave_what_it_touches(model: KoopmanModel):
    for gap in (-0.05, 0.0, 0.002):
        behind = Surroundings(rows((-0.35 - gap, 0.0, 0.2)))
        at_rest = np.zeros(2)
        assert find(np.array((0.6, 0.0)), behind, model, last=at_rest).inputs[0, 0] == 0.6
        towards = find(np.array((-0.6, 0.0)), behind, model, last=at_rest)
        assert towards.commands is not None and abs(towards.inputs[0, 0]) <= 0.02
        assert find(at_rest, behind, model).commands is not None


def test_a_robot_that_touches_one_thing_does_not_leave_it_into_another() -> None:
    ahead, behind = (0.34, 0.0, 0.2), (-0.354, 0.0, 0.2)
    for circles in (rows(ahead, behind), rows(behind, ahead)):
        motion = find(np.array((-0.3, 0.0)), Surroundings(circles))
        assert -0.004 < 0.1 * motion.inputs[0, 0] <= 0.0
    # what it grazes on its way out does not hold it
    beside = (0.0, 0.349, 0.2)
    assert find(np.array((-0.3, 0.0)), Surroundings(rows(ahead, beside))).inputs[0, 0] < -0.07


def test_what_leads_past_a_thing_on_a_floor_that_pushes_is_slow_and_what_leads_away_is_not() -> (
    None
):
    model = slipping(0.2)

    def driven(turned: float, gap: float, pose_error: float | None = None) -> float:
        towards = turned - 0.5 * np.pi
        place = (0.35 + gap) * np.array((np.cos(towards), -np.sin(towards)))
        around = Surroundings(rows((*-place, 0.2)))
        motion = find(np.array((0.6, 0.0)), around, model, pose_error=pose_error)
        return float(motion.inputs[0, 0] / 0.6)

    assert driven(0.02, 0.002) < 0.07 and driven(0.5 * np.pi, 0.002) == 1.0
    # poses that err report a touch before there is one: the floor may push the robot on
    assert driven(0.02, 0.002, 0.01) < 0.07 and driven(0.02, -0.002, 0.01) < 0.07
    assert driven(0.5 * np.pi, -0.002, 0.01) == 1.0


@pytest.mark.parametrize("seed", range(2))
def test_no_circle_of_a_long_robot_is_led_into_a_thing(seed: int) -> None:
    random, slowed = np.random.default_rng(seed), 0
    footprint = CART.footprint
    assert footprint is not None
    for _ in range(400):
        around = random.uniform(-np.pi, np.pi)
        centre = random.uniform(0.28, 0.72) * np.array((np.cos(around), np.sin(around)))
        gap = np.hypot(*(footprint.circles - centre).T).min() - 0.1 - footprint.circle_radius
        if not 0.005 < gap < 0.05:
            continue
        command = random.uniform((-0.6, -1.5), (0.6, 1.5))
        motion = find(command, Surroundings(rows((*centre, 0.1))), problem=CART)
        slowed += motion.slowed
        places = footprint.places(to_rest(motion, NOMINAL))
        gaps = np.hypot(*(places - centre).transpose(2, 0, 1)) - 0.1 - footprint.circle_radius
        assert gaps.min() > -1e-6
    assert slowed > 4


@pytest.mark.parametrize(("gap", "drives"), [(0.05, False), (1.5, True)])
def test_a_long_robot_that_lags_stops_before_a_wall(gap: float, drives: bool) -> None:
    wall = Solids([kl.Wall(0.4 + gap, -1.0, 0.4 + gap, 1.0)])
    around = Surroundings(NOTHING, wall.whole)
    motion = find(np.array((0.6, 0.0)), around, lagging(), CART)
    assert (motion.commands is not None and not motion.slowed) is drives


def test_a_robot_with_ramps_brakes_along_its_plan_where_straight_on_something_is() -> None:
    turning = np.tile((1.5, 2.0), (20, 1))
    turning[0, 1] = 0.0
    # straight on from the coming command it would brake into this circle
    around = Surroundings(rows((0.9, -0.25, 0.3)))
    motion = find(turning, around, problem=SLOW, last=np.array((1.5, 0.0)))
    assert motion.commands is not None and not motion.slowed
    gaps = np.hypot(*(to_rest(motion, NOMINAL)[:, :2] - (0.9, -0.25)).T) - 0.45
    assert gaps.min() > 0.0 and motion.commands[3, 1] > 0.0
    blocked = find(np.tile((1.5, 0.0), (20, 1)), around, problem=SLOW)
    assert blocked.slowed or blocked.commands is None


def test_a_slower_command_of_a_robot_with_ramps_is_one_that_it_can_reach() -> None:
    last, step = np.array((1.5, 0.0)), 0.1 * np.array((1.5, 5.0))
    speeds = []
    for distance in np.linspace(1.0, 2.0, 40):
        wall = Surroundings(rows((distance, 0.0, 0.2)))
        motion = find(np.tile((1.5, 0.3), (20, 1)), wall, problem=SLOW, last=last)
        if motion.commands is not None:
            changes = np.diff(np.concatenate([last[None], motion.commands]), axis=0)
            assert (np.abs(changes) <= step + 1e-9).all()
            speeds.append(motion.inputs[0, 0])
    assert min(speeds) < 1.45 and max(speeds) == 1.5 and len(set(speeds)) > 3


def test_a_robot_stays_able_to_stop_in_what_it_knows() -> None:
    ahead, radius = np.array((0.6, 0.0)), PROBLEM.robot_radius
    for known in (0.05, 0.03):
        motion = find(ahead, Surroundings(NOTHING, known=known + radius))
        assert 0.5 * known <= 0.1 * motion.inputs[0, 0] <= known


@pytest.mark.parametrize("unsure", [0.0, 0.1])
def test_a_pedestrian_that_may_turn_is_not_driven_towards(unsure: float) -> None:
    def driven(gap: float, command: float = 0.6) -> float:
        # it walks along the robot's way, and may turn
        person = rows((gap + 0.4, 0.0, 0.25, 0.9, 0.0, unsure))
        around = Surroundings(person, swerve_time=0.3)
        return float(find(np.array((command, 0.0)), around).inputs[0, 0])

    assert driven(0.08) == 0.0 and driven(0.3) == 0.6
    assert driven(0.05, -0.6) == -0.6
    assert driven(0.12) <= (0.6 if unsure == 0.0 else driven(0.12 + 0.1 * unsure))


def test_a_drifting_floor_slows_a_motion_beside_a_thing() -> None:
    model, margins = NOMINAL, Margins(NOMINAL, PROBLEM)
    beside, inputs = Surroundings(rows((0.0, 0.39, 0.2))), np.tile((0.6, 0.0), (20, 1))
    states, none = model.rollout(np.zeros(3), inputs), np.zeros((0, 2))
    state = InnovationState()
    motions = SafeMotions(PROBLEM, StopOptions())
    task = Task(model, none, np.zeros(2), beside, margins, margins.calm)
    assert not motions.find(states, inputs, task).slowed
    for _ in range(3):
        margins.expected_errors.judge(state, np.array([0.0, -0.015, 0.0]), 0.0, inputs[0], False)
    task = task._replace(felt=margins.felt(state))
    assert motions.find(states, inputs, task).inputs[0, 0] < 0.4
