"""Commands of a robot that is not round: its ends swing."""

from __future__ import annotations

import numpy as np
import pytest
from wary import slipping

import kmpc_lite as kl
from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.margins.model_margins import Margins
from kmpc_lite.scenario.touch import footprint_gaps

CART = kl.Footprint.rectangle(0.8, 0.3)
PROBLEM = kl.NavigationProblem(footprint=CART, u_max=(0.6, 1.5), u_min=(-0.6, -1.5))
MARGINS = Margins(kl.nominal_unicycle(0.1), PROBLEM)


def share(command: tuple[float, float], *circles: tuple[float, float, float]) -> float:
    rows = np.array([(*circle, 0.0, 0.0) for circle in circles]).reshape(-1, 5)
    ahead = np.repeat(rows[None], len(CART.circles), axis=0)
    found = MARGINS.command_check.speed_share(DriftState(), np.zeros(3), np.array(command), ahead)
    return found.share


def test_far_from_everything_it_is_whole() -> None:
    assert share((0.6, 1.0)) == 1.0
    assert share((0.6, 1.0), (3.0, 0.0, 0.2)) == 1.0


def test_a_turn_that_swings_an_end_into_something_is_slowed() -> None:
    beside_the_front = (0.3, 0.3, 0.1)
    assert share((0.0, 1.5), beside_the_front) < 0.5
    assert share((0.0, -1.5), beside_the_front) == 1.0
    # turning away from that swings the back into another
    behind = (-0.3, 0.3, 0.1)
    assert share((0.0, -1.5), beside_the_front, behind) < 0.5
    # a round robot of the same width would turn
    assert share((0.0, 1.5), (0.0, 0.35, 0.1)) == 1.0


def test_who_touches_may_leave_but_not_press_on() -> None:
    touching = (0.55, 0.0, 0.1)
    assert share((0.4, 0.0), touching) == 0.0
    assert share((-0.4, 0.0), touching) >= 0.25
    between = (-0.55, 0.0, 0.1)
    assert share((-0.4, 0.0), touching, between) == 0.0


@pytest.mark.parametrize("seed", range(2))
def test_no_share_leads_into_an_obstacle(seed: int) -> None:
    random, slowed = np.random.default_rng(seed), 0
    model = kl.nominal_unicycle(0.1)
    for _ in range(600):
        around = random.uniform(-np.pi, np.pi)
        centre = random.uniform(0.28, 0.72) * np.array((np.cos(around), np.sin(around)))
        gap = np.hypot(*(CART.circles - centre).T).min() - 0.1 - CART.circle_radius
        if not 0.005 < gap < 0.05:
            continue
        command = random.uniform((-0.6, -1.5), (0.6, 1.5))
        found = share(tuple(command), (*centre, 0.1))
        slowed += found < 1.0
        moments = np.linspace(0.0, 1.0, 4)[1:]
        poses = np.array([model.predict(np.zeros(3), m * found * command) for m in moments])
        circles = np.tile((*centre, 0.1), (3, 1, 1))
        assert footprint_gaps(CART, poses, circles, []).min() > 0.0
    assert slowed > 4


def test_margins_ask_for_more_where_the_heading_errs_and_the_robot_is_long() -> None:
    model = slipping(0.2)
    inputs = np.tile((0.4, 0.5), (20, 1))
    states = model.rollout((0.0, 0.0, 0.0), inputs)
    lin = model.linearize(states[:-1], inputs)
    tightening, drift = Margins(model, PROBLEM).tightening, DriftState()
    middle = tightening.margins(drift, lin, states, inputs, np.tile((0.0, 1.0, 0.0), (20, 1, 1)))
    ahead = tightening.margins(drift, lin, states, inputs, np.tile((0.0, 1.0, 0.4), (20, 1, 1)))
    assert (ahead[5:] > middle[5:]).all()
    assert tightening.widest(drift) > ahead.max()
