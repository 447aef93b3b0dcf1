"""Where the robot is, and what its model is worth: old poses, what was sent, learning, drift."""

from __future__ import annotations

from typing import TYPE_CHECKING

from kmpc_lite.adaptation.online import OnlineAdaptation
from kmpc_lite.control.estimate.command_history import CommandHistory
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.margins.drift_detector import DriftDetector, DriftState


def adapt(
    adaptation: OnlineAdaptation, history: CommandHistory, pose: Array, scale: Scale
) -> KoopmanModel | None:
    """Show the past period to the adaptation; the model that it may give.

    Parameters
    ----------
    adaptation : OnlineAdaptation
        In metres and seconds.
    history : CommandHistory
        Updated with the pose.
    pose : ndarray
        Measured (3,), in the robot's units.
    scale : Scale
        The robot's units.
    """
    before, model = history.driven, None
    if before is not None:
        model = adaptation.update(
            before.pose * scale.state,
            before.command * scale.command,
            pose * scale.state,
            before.earlier * scale.command,
        )
    history.measured = pose.copy()
    return model


def observe_drift(
    detector: DriftDetector, state: DriftState, history: CommandHistory, here: Array
) -> None:
    """Compare the pose with what the last plan expected: how wrong the model was widens margins."""
    planned = history.planned
    if planned is not None and planned.expected is not None:
        error = here - planned.expected
        detector.observe(state, error, float(planned.pose[2]), planned.command)
