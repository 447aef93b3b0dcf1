"""What happens to a controller, for `logging`: path changed, drift, refused pose, stop.

The loggers below ``kmpc_lite`` are never configured here; a program that wants to read them calls
``logging.basicConfig(level=logging.INFO)``. Each event is told once, not at every step.
"""

from __future__ import annotations

import logging
import re

from kmpc_lite.control.plan import GoalProgress, PlanStatus

logging.getLogger("kmpc_lite").addHandler(logging.NullHandler())
LOG = logging.getLogger("kmpc_lite.control")
NUMBERS = re.compile(r"\d+(\.\d+)?")


class Events:
    """Tells what is new; nothing is decided by it, so that it is no part of a drive's state."""

    def __init__(self) -> None:
        self._told = ""
        self._drifting = False

    def path(self, switched: bool) -> None:
        """Note whether the robot follows another path from now on."""
        if switched:
            LOG.info("path changed")

    def drift(self, drifting: bool) -> None:
        """Note whether the floor pushes the robot to one side."""
        if drifting != self._drifting:
            LOG.warning("drift: the floor pushes the robot") if drifting else LOG.info("drift over")
        self._drifting = drifting

    def refused(self, reason: str) -> None:
        """Note that a step could not be planned from what was measured."""
        self._tell(logging.WARNING, f"refused: {reason}")

    def planned(self, status: PlanStatus, progress: GoalProgress, reason: str) -> None:
        """Note how a plan came about."""
        if status in (PlanStatus.STOPPED, PlanStatus.FALLBACK):
            self._tell(logging.WARNING, f"stop: {reason}")
        elif progress in (GoalProgress.UNREACHABLE, GoalProgress.WAITING):
            self._tell(logging.WARNING, f"{progress.value}: {reason}")
        elif self._told:
            self._told = ""
            LOG.info("%s again", progress.value)

    def _tell(self, level: int, text: str) -> None:
        """Log what was not the last thing that was told, numbers aside."""
        kind = NUMBERS.sub("#", text)
        if kind != self._told and not (self._told.startswith("refused") and kind[:4] == "stop"):
            LOG.log(level, "%s", text)
            self._told = kind
