"""Stops of a robot that is not round: turning is driving, too."""

from __future__ import annotations

import numpy as np
import pytest
from lagging_robot import lagging

import kmpc_lite as kl
from kmpc_lite.control.kernels.clearance import things_of
from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.margins.model_margins import Margins
from kmpc_lite.control.options import StopOptions
from kmpc_lite.control.stop.body_stop import BodyStopTrajectories
from kmpc_lite.control.stop.stop_task import CheckedPlan, StopTask
from kmpc_lite.control.stop.stop_trajectory import StopTrajectories, stop_trajectories
from kmpc_lite.control.world.body_half_planes import BodyKeepOut
from kmpc_lite.control.world.solids import Solids
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

CART = kl.Footprint.rectangle(0.8, 0.3)
PROBLEM = kl.NavigationProblem(footprint=CART)


def find(
    command: tuple[float, float],
    circles: Array,
    solids: Solids | None = None,
    model: KoopmanModel | None = None,
) -> CheckedPlan:
    model = kl.nominal_unicycle(0.1) if model is None else model
    past = np.tile(command, (model.history, 1))
    inputs = np.tile(command, (20, 1))
    states = model.rollout(np.zeros(3), inputs, past)
    circles, nearby = things_of(circles), None if solids is None else solids.whole
    ahead = BodyKeepOut(PROBLEM, CART, 10).clearances(states, circles, nearby).solids_ahead
    task = StopTask(
        model,
        past,
        np.array(command),
        circles,
        nearby,
        ahead,
        Margins(model, PROBLEM).command_check,
        DriftState(),
    )
    return BodyStopTrajectories(PROBLEM, CART, StopOptions()).find(states, inputs, task)


def test_a_round_robot_has_its_own() -> None:
    made = stop_trajectories(kl.NavigationProblem(), StopOptions(), 0.0)
    assert type(made) is StopTrajectories
    assert type(stop_trajectories(PROBLEM, StopOptions(), 0.0)) is BodyStopTrajectories


def test_turning_beside_a_post_is_slowed_and_not_made_a_turn_on_the_spot() -> None:
    post = np.array([[0.35, 0.285, 0.1, 0.0, 0.0]])
    checked = find((0.0, 0.78), post)
    assert checked.slowed and abs(checked.inputs[0, 1]) < 0.6
    assert not find((0.0, -0.78), post).slowed
    assert not find((0.0, 0.78), post + (1.0, 0.0, 0.0, 0.0, 0.0)).slowed


def test_passing_a_corner_is_not_entering_it() -> None:
    # the front has passed the corner: its half-plane there would cut the robot's back
    corner = Solids([kl.Polygon([(-2.0, 0.25), (0.0, 0.25), (0.0, 2.0), (-2.0, 2.0)])])
    checked = find((0.5, 0.0), np.empty((0, 5)), corner)
    assert checked.stop is not None and not checked.slowed


@pytest.mark.parametrize(("gap", "drives"), [(0.05, False), (1.5, True)])
def test_one_that_lags_stops_before_a_wall(gap: float, drives: bool) -> None:
    wall = Solids([kl.Wall(0.4 + gap, -1.0, 0.4 + gap, 1.0)])
    checked = find((0.6, 0.0), np.empty((0, 5)), wall, lagging())
    assert (checked.stop is not None and not checked.slowed) is drives
