"""How far to go from the present trajectory towards what the QP found.

The merit function is exact: objective, linear and quadratic penalties on obstacles, and a linear
penalty on what the trajectory lacks of obeying the model. Full steps of the Gauss-Newton QP, which
does not know how the dynamics bend, go back and forth between two plans on one state in ten.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.task import Task
from kmpc_lite.control.nmpc.trajectory import Trajectory, command_windows
from kmpc_lite.control.options import SolverOptions, fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.half_planes import KeepOut
from kmpc_lite.types import Array

ROUNDING = 1e-10
"""Share of the merit that rounding may take once nothing is left to gain."""
DUAL_EXCESS = 1.1
"""Factor by which the penalty on the dynamics exceeds their largest multiplier: more than one, and
the merit function is exact."""


@dataclass(slots=True)
class Penalties:
    """Linear weights of the merit function; they grow within a step."""

    slack: float
    """Of entering obstacles [1/m]."""
    dynamics: float = 0.0
    """Of contradicting the model."""


class Direction(NamedTuple):
    """Where a QP says to go."""

    guess: Trajectory
    """Where it was linearised."""
    found: Trajectory
    """Its solution."""
    guess_predicted: Array
    """What the model says of stages 1 to N of `guess`, each from the stage before, (N, 3)."""
    found_predicted: Array
    """The same of `found`."""
    slack: Array
    """(N,) slacks of the solution [m]."""
    violation: Array
    """(N,) how far `guess` violates half-planes [m]."""
    margins: Array | float
    """(N, K) that obstacles and sides are kept away by [m]."""


class Step(NamedTuple):
    """What a line search ended with."""

    trajectory: Trajectory
    length: float
    """Share of the step to the QP's solution, from 0 to 1."""
    predicted: Array
    """What the model says of stages 1 to N of the trajectory, (N, 3)."""


class LineSearch:
    """Halves steps until the merit function falls enough (Armijo).

    Parameters
    ----------
    qp : NavigationQP
        Cost, and the rows of the dynamics.
    keep_out : KeepOut
        Measures how deep a trajectory enters obstacles.
    armijo : float
        Share of the predicted decrease that a step must bring.
    clock : callable
        Gives the time that deadlines are on [s].
    """

    def __init__(
        self, qp: NavigationQP, keep_out: KeepOut, armijo: float, clock: Callable[[], float]
    ) -> None:
        self._qp, self._problem, self._keep_out = qp, qp.problem, keep_out
        self._armijo, self._clock = armijo, clock

    def search(
        self, penalties: Penalties, direction: Direction, task: Task, shortest: float
    ) -> Step:
        """Go from the guess towards what the QP found until the merit function falls enough.

        Parameters
        ----------
        penalties : Penalties
            That of the dynamics grows where it is too weak for this QP.
        direction : Direction
            From where, to where.
        task : Task
            Reference, obstacles and deadline.
        shortest : float
            Length at which the search ends.
        """
        guess, found, before, predicted, slack, violation, margins = direction
        cost, reference, share = self._problem.cost, task.reference, task.terminal_share
        largest_dual = float(np.abs(found.duals[self._qp.dynamics_rows]).max())
        penalties.dynamics = max(penalties.dynamics, DUAL_EXCESS * largest_dual)
        defect = float(np.abs(guess.states[1:] - before).sum())
        objective = cost(guess.states, guess.inputs, reference, share)
        now = self.merit(penalties, objective, violation, defect)
        objective = cost(found.states, found.inputs, reference, share)
        expected = now - objective - self._penalty(penalties, np.maximum(slack, 0.0))
        length, trial = 1.0, found
        while True:
            inside = self._keep_out.penetration(trial.states, task.things, task.solids, margins)
            defect = float(np.abs(predicted - trial.states[1:]).sum())
            merit = self.merit(penalties, objective, inside, defect)
            enough = now - self._armijo * length * expected + ROUNDING * abs(now)
            if merit <= enough or length <= shortest:
                return Step(trial, length, predicted)
            if self._clock() > task.deadline:
                # what a QP stopped at once has left is no direction: the plan stays
                return Step(guess, 0.0, before)
            length *= 0.5
            states = guess.states + length * (found.states - guess.states)
            inputs = guess.inputs + length * (found.inputs - guess.inputs)
            trial = Trajectory(states, inputs, found.duals)
            objective = cost(trial.states, trial.inputs, reference, share)
            predicted = predict_stages(trial, task)

    def merit(
        self, penalties: Penalties, objective: float, violation: Array, defect: float
    ) -> float:
        """Exact merit function of an objective, violations (N,) [m], and a sum of defects."""
        return objective + self._penalty(penalties, violation) + penalties.dynamics * defect

    def _penalty(self, penalties: Penalties, violation: Array) -> float:
        """Exact penalty on the violation of each stage (N,) [m]."""
        quadratic = self._problem.slack_weights[1] * (violation @ violation)
        return float(penalties.slack * violation.sum() + quadratic)


def predict_stages(trajectory: Trajectory, task: Task) -> Array:
    """What the model says of stages 1 to N, (N, 3), each from the stage before."""
    past = command_windows(task.model.history, task.past, trajectory.inputs)
    predicted: Array = task.model.predict(trajectory.states[:-1], trajectory.inputs, past)
    return predicted


def short_limits(problem: NavigationProblem, options: SolverOptions) -> tuple[Array, Array]:
    """Changes of all states and commands that are short, and defects of a stage that are small."""
    length, (speed, turn_rate) = unit_length(problem), fastest(problem)
    state = options.short_step * length, options.short_step * length, options.short_turn
    command = options.short_speed_change * speed, options.short_turn_rate_change * turn_rate
    short = np.concatenate([np.tile(part, problem.horizon) for part in (state, command)])
    defect = options.straight_defect * length
    return short, np.array((defect, defect, options.straight_turn_defect))
