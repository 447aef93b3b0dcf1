"""What follows from the learned model, and from the one in use where adaptation corrected it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from kmpc_lite.control.kernels.predictor import motion_in_units
from kmpc_lite.control.margins import Margins
from kmpc_lite.control.options import ControllerOptions, fastest
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.units import scaled_problem, with_goal_weights, with_tracking_weights
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.scale import Scale

if TYPE_CHECKING:
    from kmpc_lite.control.path.capabilities import Capabilities


@dataclass(frozen=True, eq=False, slots=True)
class Knowledge:
    """All that follows from the model in use."""

    model: MotionModel
    """Predicts, in the robot's units."""
    margins: Margins | None
    """None without tightening."""
    capabilities: Capabilities | None
    """None without guidance."""


LITTLE_TURN = 0.25
"""Turn in a period [rad] up to which the midpoint rule is exact enough: it drives ``turn^2 / 24``
too far, here 0.3 %, which is far below what slip does, and takes half the time."""


def motion_model(model: KoopmanModel, units: NavigationProblem, scale: Scale) -> MotionModel:
    """Return a model in the robot's units, as all phases of a step use it."""
    turns_little = units.dt * fastest(units)[1] <= LITTLE_TURN
    driven = replace(model, integrator="midpoint" if turns_little else model.integrator)
    return motion_in_units(driven, scale)


def problem_in_units(
    problem: NavigationProblem, model: KoopmanModel, guides: bool
) -> NavigationProblem:
    """Return a problem in the robot's units, with the weights that its mode uses by default."""
    units = scaled_problem(problem, problem.scale)
    if not guides:
        return with_goal_weights(units)
    from kmpc_lite.control.path.capabilities import speed_shares

    # where the robot does not reach its command bounds, the weights say so
    shares = speed_shares(motion_model(model, units, problem.scale), units)
    return with_tracking_weights(units, shares)


class Examiner:
    """Asks models for margins and capabilities; those of the learned model are worked out once."""

    def __init__(
        self,
        units: NavigationProblem,
        scale: Scale,
        options: ControllerOptions,
        tightens: bool,
        guides: bool,
    ) -> None:
        self._units, self._scale, self._options = units, scale, options
        self._tightens, self._guides = tightens, guides
        self._learned: tuple[KoopmanModel, Capabilities] | None = None

    def examine(self, base: KoopmanModel, model: KoopmanModel) -> Knowledge:
        """Work out all that follows from the learned model and the one in use."""
        adapted = model is not base
        motion = motion_model(model, self._units, self._scale)
        margins = self._margins(motion, adapted)
        if not self._guides:
            return Knowledge(motion, margins, None)
        found = self._learned_capabilities(base)
        if adapted:
            found = found.adapted(motion, self._units, self._options.guidance.turn_share)
        return Knowledge(motion, margins, found)

    def _margins(self, motion: MotionModel, adapted: bool) -> Margins | None:
        if not self._tightens:
            return None
        return Margins(motion, self._units, self._options.margins, adapted=adapted)

    def _learned_capabilities(self, base: KoopmanModel) -> Capabilities:
        if self._learned is None or self._learned[0] is not base:
            from kmpc_lite.control.path.capabilities import capabilities

            motion = motion_model(base, self._units, self._scale)
            options = self._options
            margins = self._margins(motion, adapted=False)
            found = capabilities(motion, self._units, margins, options.guidance, options.goal)
            self._learned = base, found
        return self._learned[1]
