"""Options of adaptation, each with its unit and its reason."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.errors import ProblemError
from kmpc_lite.option_fields import check, seconds, share


@dataclass(frozen=True, slots=True)
class AdaptationOptions:
    """How fast, and how far, adaptation corrects a model.

    Times are in seconds of the robot's units.
    """

    window: float = seconds(2.0, zero=False)
    """Length of the newest drive in which a change is looked for [s]: 20 steps of 0.1 s determine
    gains well enough to predict 1 s ahead."""
    memory: float = seconds(30.0, zero=False)
    """Memory of the slow estimate [s]: short enough to follow a floor that wears."""
    window_alarm: float = share(40.0, zero=False)
    """Squared distance, in standard errors over the gains, between the window's estimate and the
    gains in use that counts as a change. Chance alone gives 4, but few steps are heavy-tailed."""
    memory_alarm: float = share(30.0, zero=False)
    """The same for the slow estimate."""
    least_gain: float = share(0.2, zero=False)
    """A floor leaves at least this share of a commanded speed or turn; mud or ice that takes more
    is no floor to drive on."""
    largest_gain: float = share(2.5, zero=False)
    """No robot drives farther than its model says by a larger factor: even a log driven at half the
    speed explains only a factor of two."""

    def __post_init__(self) -> None:
        check(self)
        if not self.window < self.memory:
            raise ProblemError(
                f"AdaptationOptions: expected window < memory, got {self.window:g} "
                f"and {self.memory:g} s"
            )
        if not self.least_gain < 1.0 < self.largest_gain:
            raise ProblemError(
                "AdaptationOptions: expected least_gain < 1 < largest_gain, "
                f"got {self.least_gain:g} and {self.largest_gain:g}"
            )
