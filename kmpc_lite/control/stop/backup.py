"""The last safe motion, which is driven on when no new one can be had; then the robot brakes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.types import Array


@dataclass(slots=True)
class BackupState:
    """What is left of the last safe motion, and the last command sent."""

    motion: Array | None = None
    """(T, 2) from the command sent last to rest; none if there is none."""
    command: Array = field(default_factory=lambda: np.zeros(2))
    """(2,) sent last."""
    expected: Array | None = None
    """Pose (3,) at the begin of the period for which `rest` gives commands, as the model says."""

    @property
    def rest(self) -> Array | None:
        """What is left of the motion (T, 2) after the command sent last; none after its end."""
        return None if self.motion is None or len(self.motion) < 2 else self.motion[1:].copy()

    def sent(self, motion: Array | None, command: Array, expected: Array | None) -> None:
        """Remember a motion (T, 2), its first command as sent (2,), and where that leads (3,)."""
        self.motion, self.command = motion, command.copy()
        self.expected = None if expected is None else expected.copy()
