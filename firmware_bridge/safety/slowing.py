"""How fast a robot may drive while its pose, its scan or its command is late."""

from __future__ import annotations

import math

from firmware_bridge.messages import LinkStatus, State, VelocityCommand
from firmware_bridge.safety.gate_settings import GateSettings


class Slowing:
    """Slows the robot before pose, scan or command is too old, so that a gap is not yet a stop.

    Parameters
    ----------
    settings : GateSettings
        `watchdog`, `pose_age`, `scan_age` and `slow_from` are used.
    late_after : float, optional
        Age at which a command is late, if later than the settings say [s].
    """

    def __init__(self, settings: GateSettings, late_after: float | None) -> None:
        self._settings = settings
        own = settings.slow_from * settings.watchdog
        self._late = min(max(own, late_after or 0.0), settings.watchdog)

    def share(
        self, now: float, command: VelocityCommand, state: State | None, status: LinkStatus
    ) -> float:
        """Share of its speed limits that the robot may drive now."""
        s = self._settings
        scan = now if status.scan_stamp is None else status.scan_stamp
        pose = min(status.pose_stamp, -math.inf if state is None else state.stamp)
        return min(
            falling(now - pose, s.slow_from * s.pose_age, s.pose_age),
            falling(now - scan, s.slow_from * s.scan_age, s.scan_age),
            falling(now - command.stamp, self._late, s.watchdog),
        )


def falling(age: float, late: float, latest: float) -> float:
    """Fall from 1 at the age `late` to 0 at `latest`.

    Examples
    --------
    >>> [falling(age, 0.25, 0.75) for age in (-0.1, 0.25, 0.5, 0.75, 2.0)]
    [1.0, 1.0, 0.5, 0.0, 0.0]
    """
    if age <= late:
        return 1.0
    return 0.0 if age >= latest else (latest - age) / (latest - late)
