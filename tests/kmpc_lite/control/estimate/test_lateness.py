"""How late a robot answers is found from its motion, and from nothing else."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.studies.any_robot import Robot, RobotPlant
from kmpc_lite.control.estimate.history import Lateness, LatenessState

MODEL = kl.nominal_unicycle(0.1)
KEPT = 20


def found(late: int, turns_late: int = -1, gain=1.0, noise=0.0, age=0.0) -> list[int]:
    """Periods found at each step of a robot that drives and turns so late, at random commands."""
    random = np.random.default_rng(3)
    state, lateness = LatenessState(), Lateness(kl.NavigationProblem(), age)
    held = random.uniform((-0.3, -0.7), (0.6, 0.7), (30, 2)).repeat(4, axis=0)
    given = np.concatenate([np.zeros((KEPT, 2)), held])
    turns_late = late if turns_late < 0 else turns_late
    pose, out = np.zeros(3), list[int]()
    for k in range(KEPT, len(given)):
        pose = MODEL.predict(pose, (given[k - late, 0], gain * given[k - turns_late, 1]))
        lateness.see(state, MODEL, given[: k + 1], pose + noise * random.normal(size=3))
        out.append(state.found.min())
    return out


@pytest.mark.parametrize("late", [0, 1, 3, 6])
def test_a_delay_is_found_and_kept(late: int) -> None:
    for gain in (1.0, 0.6):
        assert set(found(late, gain=gain, noise=0.002)[60:]) == {late}


def test_the_shorter_delay_counts_and_neither_noise_nor_a_known_age_is_one() -> None:
    assert set(found(0, noise=0.01)) == {0}
    assert (found(4, turns_late=2)[-1], found(1, turns_late=3)[-1]) == (2, 1)
    # of a pose that is two periods old, only what is beyond them is news
    assert (found(2, age=0.2)[-1], found(3, age=0.2)[-1]) == (0, 1)


def test_missing_poses_tell_nothing_nor_do_those_after_them() -> None:
    state, lateness = LatenessState(), Lateness(kl.NavigationProblem(), 0.0)
    given = np.random.default_rng(0).uniform(0.1, 0.5, (KEPT, 2))
    for pose in (np.zeros(3), None, np.ones(3), None):
        assert not lateness.see(state, MODEL, given, pose)
    assert state.count == 0.0


def test_ramps_that_nobody_told_of_are_found_within_two_seconds() -> None:
    plain = Robot("untold", speed=1.0, turn_rate=1.3)
    ramped = replace(plain, ramps=(2.0, 2.0), turn_ramp=0.9)
    # where poses are noisy, adaptation takes the ramp for a gain first
    noisy = replace(ramped, turn_ramp=0.5, dt=0.05, noise=(0.004, 0.01), slip=0.08)
    for robot in (noisy, ramped, replace(plain, lag=0.3), replace(plain, turn_gain=0.5), plain):
        controller = kl.Controller(kl.nominal_unicycle(robot.dt), robot.problem(10.0))
        plant, pose, random = RobotPlant(robot, 0), np.zeros(3), np.random.default_rng(0)
        for _ in range(50 if robot is noisy else 20):
            seen = pose + np.array(robot.noise)[[0, 0, 1]] * random.normal(size=3)
            plan = controller.step(seen, (-3.0, 2.0, 1.0))
            pose = plant.drive(pose, plan.command)[-1]
        changes = controller.problem.du_max
        if robot is not ramped:
            assert 0.35 < changes[0] < 0.65 if robot is noisy else np.isinf(changes).all()
            continue
        assert changes == pytest.approx((0.45, 1.3), rel=0.15)
        # a drive goes on elsewhere, and what was learned is forgotten with it
        twin = pickle.loads(pickle.dumps(controller))
        one, other = (c.step(pose, (3.0, 2.0, 1.0)).states for c in (controller, twin))
        np.testing.assert_array_equal(one, other)
        controller.reset()
        assert np.isinf(controller.problem.du_max).all()


def test_ramps_that_were_felt_change_no_units_and_soften_no_emergency() -> None:
    robot = Robot("a minute to full speed", ramps=(60.0, 60.0), turn_ramp=0.01)
    controller = kl.Controller(MODEL, robot.problem(20.0))
    plant, pose, scale = RobotPlant(robot, 0), np.zeros(3), controller.scale
    for _ in range(100):
        pose = plant.drive(pose, controller.step(pose, (3.0, 0.0, 0.0)).command)[-1]
    assert controller.scale == scale and np.isfinite(controller.problem.du_max[0])
    plan = controller.step(pose, (3.0, 0.0, 0.0), [kl.Circle(pose[0] + 0.301, 0.0, 0.15)])
    assert plan.status.name == "STOPPED" and not plan.command[0]
    assert controller.state.history.command[0] > 0.02  # it rolls on


def test_a_robot_that_lags_unknown_to_its_model_parks() -> None:
    """It swung about its goal for ever; without adaptation nothing is looked for."""
    for adaptation, late in ((None, 4), (False, 0)):
        controller = kl.Controller(MODEL, adaptation=adaptation)
        pose, pipe = np.zeros(3), [np.zeros(2)] * 4
        for _ in range(100):
            plan = controller.step(pose, (1.5, 0.8, 1.0), np.array([[0.8, 0.2, 0.2]]))
            pipe.append(plan.command)
            pose = MODEL.predict(pose, pipe.pop(0))
        found = controller.state.lateness
        assert (0 if found is None else found.found.min()) == late
        assert plan.holding is (adaptation is None)
