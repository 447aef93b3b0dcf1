"""Options of safe motions: what is tried, and what clearance may be used up."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, part, seconds


@dataclass(frozen=True, slots=True)
class StopOptions:
    """Which motions to rest are tried, and what clearance they must keep."""

    further_time: float = seconds(0.5)
    """How much of the plan's rest is tried before the brake [s]: a robot that lags may have to
    drive on to stop clear of what it passes."""
    spend_share: float = part(0.25)
    """Share of the present clearance, as far as it is sure, that a motion may use up if that
    clearance is less than the margin: a robot near an obstacle may pass by, one that touches may
    get free."""
    swerve_time: float = seconds(0.3)
    """Longest time for which a moving obstacle may walk in any direction at its speed [s]."""

    def __post_init__(self) -> None:
        check(self)
