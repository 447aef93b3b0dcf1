"""All that depends on a model's noise: margins of plans and of motions, and innovations."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.kernels import NUMPY, Kernels
from kmpc_lite.control.margins.model_noise import ModelNoise
from kmpc_lite.control.margins.obstacle_margins import Tightening
from kmpc_lite.control.margins.stop_margins import StopMargins
from kmpc_lite.control.options import MarginOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.motion import MotionModel


class Margins:
    """Margins of plans, those of motions, and what innovations are expected, for one model.

    It remembers nothing of a drive: the noise as past innovations inflate it (`Tightening.felt`) is
    the first argument of all that depends on them. Another model gets other `Margins`.

    Parameters
    ----------
    model : MotionModel
        Its noise model and its table of quantiles; without these only speed and chords count.
    problem : NavigationProblem
        Horizon, period, robot radius, margin and command bounds.
    options : MarginOptions
        Risks and tolerances.
    adapted : bool
        Whether the model was corrected while driving: it knows its floor from a few seconds, so
        that single commands are made safe for rarer errors.
    kernels : Kernels
        Compute them.

    Attributes
    ----------
    noise : ModelNoise
        Noise and quantiles.
    expected_errors : ExpectedErrors
        Tells whether the robot does otherwise than its model says.
    tightening : Tightening
        Margins of plans.
    stop_margins : StopMargins
        Margins of motions that are about to be driven.

    Raises
    ------
    ProblemError
        For a damaged table of quantiles in the model.

    Examples
    --------
    >>> import numpy as np
    >>> from kmpc_lite import nominal_unicycle
    >>> model = nominal_unicycle(0.1)
    >>> margins = Margins(model, NavigationProblem())
    >>> inputs = np.tile([0.6, 0.0], (20, 1))
    >>> states = model.rollout((0.0, 0.0, 0.0), inputs)
    >>> lin, left = model.linearize(states[:-1], inputs), np.tile([0.0, 1.0], (20, 4, 1))
    >>> calm = margins.tightening.calm
    >>> found = margins.tightening.margins(calm, lin, states, inputs, left)
    >>> found.shape, float(found[0, 0].round(4))
    ((20, 4), 0.068)
    """

    def __init__(
        self,
        model: MotionModel,
        problem: NavigationProblem,
        options: MarginOptions | None = None,
        *,
        adapted: bool = False,
        kernels: Kernels = NUMPY,
    ) -> None:
        options = MarginOptions() if options is None else options
        self.noise = ModelNoise(model, problem, options, adapted)
        self.expected_errors = self.noise.expected_errors
        self.tightening = Tightening(self.noise, problem, options)
        self.stop_margins = StopMargins(self.noise, problem, kernels)
        self._model, self._horizon = model, problem.horizon
        self._directions = 2 if problem.footprint is None else 3

    def straight(self, speed: float) -> tuple[float, float]:
        """Margins ahead and aside [m] of the last stage of a straight drive, without headway.

        Parameters
        ----------
        speed : float
            [m/s], held for long before.
        """
        model, stages = self._model, self._horizon
        command = np.zeros(model.inputs)
        command[0] = speed
        inputs = np.tile(command, (stages, 1))
        states = np.zeros((stages + 1, 3))
        states[:, 0] = speed * model.dt * np.arange(stages + 1)
        past = np.tile(command, (stages, model.history, 1))
        lin = model.linearize(states[:-1], inputs, past)
        normals = np.tile(np.eye(2, self._directions), (stages, 1, 1))
        found = self.tightening.margins(
            self.tightening.calm, lin, states, inputs, normals, path_clearance=0.0
        )
        return float(found[-1, 0]), float(found[-1, 1])
