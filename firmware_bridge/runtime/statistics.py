"""What the control loop counts and measures in a drive, and how it is reported."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.observer import Change
from firmware_bridge.runtime.timing import Histogram

REPORTED_CHANGES = 100  # the gate's last changes of state that a report lists


@dataclass
class Statistics:
    """Counts of a drive; their memory does not grow."""

    ticks: int = 0
    skipped: int = 0  # ticks left out after a stall
    sent: int = 0
    refused: int = 0  # commands that the driver would not take
    driver_errors: int = 0
    last_error: str = ""
    reasons: Counter[str] = field(default_factory=Counter)
    """Number of ticks at which each reason held."""
    late: Histogram = field(default_factory=Histogram)
    work: Histogram = field(default_factory=Histogram)
    pose_to_wire: Histogram = field(default_factory=Histogram)
    spacing_error: Histogram = field(default_factory=Histogram)

    def guarded(self, action: Callable[[], None]) -> bool:
        """Call what may raise anything; count that, and tell whether it went well."""
        try:
            action()
        except Exception as error:  # no exception of a driver or a log leaves the loop
            self.note(error)
            return False
        return True

    def note(self, error: Exception) -> None:
        """Count an error of a driver or an observer."""
        self.driver_errors += 1
        self.last_error = f"{type(error).__name__}: {error}"

    def histograms(self, planner: Planner) -> dict[str, Histogram]:
        """Histograms of times, by name."""
        return {
            "pose age when planning": planner.pose_age,
            "controller": planner.step_time,
            "pose to command on the wire": self.pose_to_wire,
            "gate period, late by": self.late,
            "gate and driver, work": self.work,
            "command spacing, off by": self.spacing_error,
        }

    def report(
        self, planner: Planner, stop_reason: str, changes: Sequence[tuple[float, Change]]
    ) -> dict[str, Any]:
        """Plain values, for JSON: counts, times [ms], and changes by the time of the drive [s]."""
        return {
            "ticks": self.ticks,
            "ticks_skipped": self.skipped,
            "commands_sent": self.sent,
            "commands_refused": self.refused,
            "controller_errors": planner.errors,
            "controller_periods_skipped": planner.skipped,
            "errors": self.driver_errors,
            "last_error": self.last_error or planner.last_error,
            "stop_reason": stop_reason,
            "reasons": dict(self.reasons),
            "changes": [_told(*change) for change in changes[-REPORTED_CHANGES:]],
            "times_ms": {name: t.summary() for name, t in self.histograms(planner).items()},
        }


def _told(time: float, change: Change) -> dict[str, Any]:
    return {
        "time": round(time, 3),
        "from": change.before.name,
        "to": change.after.name,
        "why": list(change.why),
    }
