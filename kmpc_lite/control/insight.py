"""What was behind a plan: for logs, pages and viewers, and worked out for them alone."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.nmpc.qp import command_windows
from kmpc_lite.control.plan import Plan
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.controller import Controller

DIRECTIONS = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
"""In which margins are looked at [rad]."""


@dataclass(frozen=True, eq=False)
class Insight:
    """What the controller had in mind beside its plan."""

    path: Array  # (K, 3) poses that guidance follows [m, m, rad]; (0, 3) if there is no path
    margins: Array
    """(N,) what stages 1 to N of the plan keep from obstacles beyond the radii [m], in the
    direction in which that is most."""


def insight(controller: Controller, plan: Plan) -> Insight:
    """Look behind the plan that a controller has just made; changes nothing.

    To be called between two steps, in the thread that makes them.

    Examples
    --------
    >>> from kmpc_lite import Circle, Controller, nominal_unicycle
    >>> controller = Controller(nominal_unicycle(0.1))
    >>> plan = controller.step((0, 0, 0), goal=(1.5, 1.5, 0), obstacles=[Circle(0.7, 0.7, 0.15)])
    >>> found = insight(controller, plan)
    >>> found.path.shape[1], found.margins.shape
    (3, (20,))
    """
    path, guide = np.empty((0, 3)), controller.state.guide
    if guide is not None and guide.path is not None:
        path = guide.path.timed.poses * controller.scale.state
    return Insight(path, _margins(controller, plan))


def _margins(controller: Controller, plan: Plan) -> Array:
    """Margins (N,) of a plan's stages [m]."""
    state, scale, known = controller.state, controller.scale, controller.known
    asked = np.full(len(plan.inputs), float(controller.problem.margin))
    if known.margins is None or not np.isfinite(plan.states).all():
        return asked
    states, inputs = plan.states / scale.state, plan.inputs / scale.command
    past = command_windows(known.model.history, state.history.commands, inputs)
    lin = known.model.linearize(states[:-1], inputs, past)
    around = np.column_stack([np.cos(DIRECTIONS), np.sin(DIRECTIONS)])
    if controller.problem.footprint is not None:
        around = np.column_stack([around, np.zeros(len(around))])
    clearance: float | Array = math.inf
    if state.guide is not None:
        clearance = state.guide.kept_on_the_way(states, controller.units.inflation)
    felt = known.margins.felt(state.innovation)
    found = known.margins.of_plan(
        felt, lin, states, inputs, np.tile(around, (len(inputs), 1, 1)), clearance
    )
    out: Array = asked + found.max(axis=1) * scale.length
    return out
