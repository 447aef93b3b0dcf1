"""Margins of a robot that is not round: its ends swing."""

import numpy as np
from wary import slipping

import kmpc_lite as kl
from kmpc_lite.control.margins.margins import Margins

CART = kl.Footprint.rectangle(0.8, 0.3)
PROBLEM = kl.NavigationProblem(footprint=CART, u_max=(0.6, 1.5), u_min=(-0.6, -1.5))


def test_margins_ask_for_more_where_the_heading_errs_and_the_robot_is_long() -> None:
    model = slipping(0.2)
    inputs = np.tile((0.4, 0.5), (20, 1))
    states = model.rollout((0.0, 0.0, 0.0), inputs)
    lin = model.linearize(states[:-1], inputs)
    margins = Margins(model, PROBLEM)
    middle = margins.of_plan(
        margins.calm, lin, states, inputs, np.tile((0.0, 1.0, 0.0), (20, 1, 1))
    )
    ahead = margins.of_plan(margins.calm, lin, states, inputs, np.tile((0.0, 1.0, 0.4), (20, 1, 1)))
    assert (ahead[5:] > middle[5:]).all()
    assert margins.calm.widest > ahead.max()
