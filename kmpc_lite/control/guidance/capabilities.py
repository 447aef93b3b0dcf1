"""How fast a model lets its robot be driven, and how much room it then needs: what ways are timed by, and kept away from obstacles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, Array

if TYPE_CHECKING:
    from kmpc_lite.control.margins.margins import Margins

ROUNDING = 1e-6
SPARE, MOST_ROOM = 0.02, 0.1
"""Room that a way keeps beyond the margins of a plan at full speed, and how much it keeps at the
most [m]: a plan at its margins has none to correct itself, but a passage that is driven slowly is
better than a long way around."""
LEAST = 0.05
"""Share of a bound that is believed in the least: a model may know nothing of what its log never
showed, and ways must end."""


def drivable_speeds(model: KoopmanModel, problem: NavigationProblem) -> Array:
    """Speeds that the robot holds at the command bounds, by its model, but not above the bounds themselves.

    A skid-steer robot that makes a third of a turn it is told needs three times as long for it; one
    that slips ahead is not asked for more than was commanded.

    Parameters
    ----------
    model : KoopmanModel
        With an input history it is asked for what it does once a command has been held that long.
    problem : NavigationProblem
        Command bounds.

    Returns
    -------
    ndarray
        (3,) speed ahead [m/s], backwards [m/s], and rate of turn to the slower side [rad/s]; zeros
        where a bound forbids it.

    Examples
    --------
    >>> from kmpc_lite import nominal_unicycle
    >>> drivable_speeds(nominal_unicycle(0.1), NavigationProblem(u_min=(-0.2, -0.8))).round(3)
    array([0.6  , 0.2  , 0.785])
    """
    u_min, u_max, _, _ = problem.bounds
    held = np.zeros((4, INPUTS))
    held[0, 0], held[1, 0], held[2, 1], held[3, 1] = u_max[0], u_min[0], u_max[1], u_min[1]
    past = np.repeat(held[:, None], model.history, axis=1)
    ends = model.predict(np.zeros((4, 3)), held, past)
    signed = np.array([ends[0, 0], -ends[1, 0], ends[2, 2], -ends[3, 2]]) / model.dt
    bounds = np.array([u_max[0], -u_min[0], u_max[1], -u_min[1]])
    # rounding must not decide between two ways that are equally quick
    speeds = np.where(
        signed > (1.0 - ROUNDING) * bounds, bounds, np.maximum(signed, LEAST * bounds)
    )
    return np.array([speeds[0], speeds[1], min(speeds[2], speeds[3])])


def clearance_at_speed(model: KoopmanModel, problem: NavigationProblem, margins: Margins) -> float:
    """Room [m] that a way must leave so that a plan at full speed along it keeps its margins, and `SPARE`.

    Parameters
    ----------
    model : KoopmanModel
        Tells how errors spread along a straight drive.
    problem : NavigationProblem
        Command bounds and horizon.
    margins : Margins
        Asked for the last stage's margin.
    """
    _, u_max, _, _ = problem.bounds
    commands = np.tile((u_max[0], 0.0), (problem.horizon, 1))
    past = np.tile(commands[0], (problem.horizon, model.history, 1))
    states, across = (
        np.zeros((problem.horizon + 1, 3)),
        np.tile((0.0, 1.0), (problem.horizon, 1, 1)),
    )
    states[:, 0] = u_max[0] * problem.dt * np.arange(problem.horizon + 1)
    lin = model.linearize(states[:-1], commands, past)
    # headway gives way to passages, so it asks for none
    found = margins.tightening.margins(
        DriftState(), lin, states, commands, across, path_clearance=0.0
    )
    margin = float(found[-1, 0])
    return min(SPARE + margin, MOST_ROOM)
