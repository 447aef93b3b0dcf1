"""When a pose has jumped, and when it is believed again."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.control.options.fields import angle, check, radii, seconds, share


@dataclass(frozen=True, slots=True)
class PoseOptions:
    """What a robot's motion can do in a period, and how long a pose that jumped is waited for."""

    tolerated: float = radii(1 / 3)
    """Difference from the predicted position that is never a jump [radii]: the margins bear it."""
    tolerated_turn: float = angle(0.1)
    """The same of the heading [rad]."""
    slip: float = share(1.0)
    """Difference that slipping wheels make, as a share of what was commanded: all of it where they
    slide or spin."""
    turn_slip: float = share(2.5)
    """The same of turns: adaptation learns turns of two and a half times the commanded ones, and
    must see those that it refuses."""
    slip_memory: float = seconds(0.5, zero=False)
    """How long a faster command before counts [s]: robots answer late."""
    agreement: float = seconds(2.0)
    """How long poses that jumped must agree with themselves before they are believed [s]: longer
    than errors of a second. Zero: they are believed at once."""

    def __post_init__(self) -> None:
        check(self)
