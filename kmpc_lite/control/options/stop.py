"""Options of the stop trajectories: which of them are tried, and what is clear."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.errors import ProblemError
from kmpc_lite.option_fields import check, part, radii, seconds, share, shares


@dataclass(frozen=True, slots=True)
class StopOptions:
    """How a stop trajectory is looked for, and what clearance it must keep."""

    further_time: float = seconds(0.5)
    """How much of the plan's rest is tried before the brake [s]: a robot that lags may have to
    drive on to stop clear of what it passes."""
    slower_shares: tuple[float, ...] = shares(0.5, 0.25, 0.0)
    """Shares of the coming command that are tried, in this order, where the whole one has no clear
    stop trajectory."""
    spend_share: float = part(0.25)
    """Share of the present clearance, as far as it is sure, that a stop trajectory may use up where
    that clearance is less than the margin: a robot near an obstacle may pass by, one that touches
    may get free."""
    turn_only_share: float = part(0.05)
    """A command that must be slowed to less than this share turns on the spot at its full turn
    rate: turning moves a round robot by a fraction of a millimetre, standing still would be for
    ever."""
    swerve_time: float = seconds(0.3)
    """Longest time for which who moves may walk anywhere at his speed, instead of where he walks,
    until the robot stands [s]; at least a period."""
    makes_room: float = part(0.5)
    """Cosine of the angle to the direction straight away from somebody within which a motion makes
    room for him."""
    overspeed: float = share(1.25, zero=False)
    """A robot is taken to drive up to this many times as far as its commands say, where it is only
    decided whether to look more closely."""
    quick_look_error: float = radii(1 / 30)
    """Error that is assumed of the quick look at a robot that lags [radii]; nearer to an obstacle
    than this, the stop is rolled out with the model instead."""
    quick_look_error_share: float = share(0.05)
    """The same error as a share of the distance driven; both add up."""
    longest_ramp: float = seconds(10.0, zero=False)
    """Longest braking ramp [s]; a robot that brakes more slowly is told to stand by then."""

    def __post_init__(self) -> None:
        check(self)
        shares = self.slower_shares
        if not isinstance(shares, tuple) or not all(0.0 <= share < 1.0 for share in shares):
            raise ProblemError(
                f"StopOptions.slower_shares: expected shares from 0 to below 1, got {shares!r}"
            )
