"""When a pose has jumped, and when it is believed again."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import angle, check, radii, seconds, share


@dataclass(frozen=True, slots=True)
class PoseOptions:
    """What a robot's motion can do in a period, and how long a pose that jumped is waited for."""

    tolerated: float = radii(1 / 3)
    """A position this near to the predicted one has never jumped [radii]: the margins allow for it.
    """
    tolerated_turn: float = angle(0.1)
    """A heading this near to the predicted one has never jumped [rad]."""
    slip: float = share(1.0)
    """How much more difference slipping wheels may make, as a share of the commanded distance: all
    of it where they slide or spin."""
    agreement: float = seconds(2.0)
    """Poses that jumped are believed once they have agreed with each other for this long [s], which
    is longer than errors of a second last. Zero: they are believed at once."""

    def __post_init__(self) -> None:
        check(self)
