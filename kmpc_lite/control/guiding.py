"""What is steered for in a step: along the guide's path, or the goal itself.

A robot that answers late goes on for a while as earlier commands, and the last plan, told it. What
is decided now acts after that: its path is looked up from there, not from where it is. A reference
from where it is would lie behind what the robot can do, and ask it to make up for that at full
speed; one from where it would come to if nothing followed would make a slow robot of one whose
motors lag.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.kernels.clearance import later
from kmpc_lite.control.limits import RateLimit
from kmpc_lite.control.now import Now
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.path.situation import GuideTask
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import wrap
from kmpc_lite.model.arguments import speeds
from kmpc_lite.types import INPUTS, Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.guide import Guide
    from kmpc_lite.control.path.planner import Planner
    from kmpc_lite.control.path.situation import Guidance
    from kmpc_lite.scale import Scale


class Guiding:
    """Asks the guide for the reference of a step.

    `units`: in the robot's units. `guide`: finds paths.
    """

    def __init__(self, units: NavigationProblem, guide: Guide | None) -> None:
        self._guide, self._dt = guide, units.dt
        self._inflation, self._stages = units.inflation, units.horizon + 1
        self._rates = RateLimit(units)
        self._deceleration = units.deceleration[[0, -2 if units.wheels.inputs > INPUTS else 0, -1]]

    def reference(self, now: Now, until: float) -> Guidance | None:
        """Find the reference along a path; none without guidance.

        A search is left to the next step at a time `until` [s].
        """
        state, known = now.state, now.known
        if self._guide is None or state.guide is None or known.capabilities is None:
            return None
        late, things = known.capabilities.late, now.things
        led = now.here[None]
        if late:
            going_on = np.zeros((late, known.model.inputs))
            if state.trajectory is not None:
                planned = state.trajectory.inputs[1 : late + 1]
                going_on[: len(planned)] = planned
            led = known.model.rollout(now.here, going_on, state.history.commands)
        here = led[-1]
        if late:
            things = later(things, late * self._dt)
        rest = None
        if late or self._rates.active:
            history = state.history
            still = np.zeros((known.model.history, known.model.inputs))
            braking = np.concatenate([self._rates.ramp(history.command), still])
            rest = known.model.rollout(now.here, braking, history.commands)[-1]
        heading, known_rest = float(now.here[2]), rest is not None
        rolls_on = state.history.brakes(heading, self._deceleration, known_rest)
        if now.rolls_on is not None:
            rolls_on += now.rolls_on
        task = GuideTask(
            pose=here,
            goal=now.goal,
            rolls_on=rolls_on,
            circles=things,
            solids=now.solids,
            rest=rest,
            until=until,
            view=now.view,
            speed=float(speeds(state.history.command)[0]),
            curvature=state.history.curvature,
        )
        guidance = self._guide.reference(state.guide, known.capabilities, task)
        states = guidance.states
        if late:
            states = np.concatenate([led[:-1], states])[: len(states)]
        kept = state.guide.kept_on_the_way(states, self._inflation)
        return guidance._replace(states=states, path_clearance=kept)

    def towards_goal(self, now: Now) -> Array:
        """Give the goal itself as the reference (N + 1, 3), as in the paper, without guidance."""
        here, goal, before = now.here, now.goal, now.state.turn
        turn = wrap(float(goal[2] - here[2]))
        # near a half turn, the side of the step before is kept
        if abs(turn) > 0.75 * math.pi and turn * before < 0.0 and abs(before) > 0.5 * math.pi:
            turn -= math.copysign(math.tau, turn)
        now.state.turn = turn
        return np.tile(np.array([goal[0], goal[1], here[2] + turn]), (self._stages, 1))


def make_guide(
    units: NavigationProblem,
    options: ControllerOptions,
    clock: Callable[[], float],
    planner: Planner | None,
    scale: Scale,
) -> Guide:
    """Make the guide of a robot; arguments in its units, but for the clock [s] and the planner."""
    # here, for its graph search costs as much to import as all the rest
    from kmpc_lite.control.path.guide import Guide
    from kmpc_lite.control.path.planner import InMetres

    own = None if planner is None else InMetres(planner, scale)
    moving = options.moving_obstacles
    return Guide(units, options.guidance, moving, clock, own)
