"""A lost pose: how long a standing robot waits for it, and whether it comes back near by."""

from __future__ import annotations

import math

from firmware_bridge.messages import LinkStatus, State
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import DRIVING, GateState, Reason

POSE_LOST = frozenset({Reason.POSE, Reason.SCAN, Reason.ESTIMATE, Reason.COMMAND})
"""What is wrong when only the pose, or the sight, is lost; there is no new command then either."""


class LostPose:
    """Follows the poses of a robot that drives or has just been stopped.

    Parameters
    ----------
    settings : GateSettings
        `resume` and `resume_within` are used.
    """

    def __init__(self, settings: GateSettings) -> None:
        self._settings = settings
        self._pose_only = False
        self._good: tuple[float, float] | None = None

    def strayed(
        self,
        gate: GateState,
        state: State | None,
        status: LinkStatus,
        reasons: tuple[Reason, ...],
    ) -> bool:
        """Take a step's inputs; tell whether the pose came back too far from where it was lost."""
        if gate not in DRIVING:
            self._pose_only, self._good = False, None
            return False
        # a board that distrusts its estimate reports that as a fault, too
        excused = POSE_LOST if status.pose_ok else POSE_LOST | {Reason.BOARD}
        before = gate is GateState.ACTIVE or self._pose_only
        self._pose_only = before and excused.issuperset(reasons)
        if reasons or state is None:
            return False
        last, self._good = self._good, (state.x, state.y)
        if last is None or not self._settings.resume:
            return False
        return math.dist(last, self._good) > self._settings.resume_within

    def patience(self, final: bool) -> float:
        """How long zeros are sent before the release [s]: longer where only the pose is lost."""
        s = self._settings
        return max(s.hold, s.resume) if self._pose_only and not final else s.hold
