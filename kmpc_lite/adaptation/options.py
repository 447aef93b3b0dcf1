"""Options of adaptation, each with its unit and its reason."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.errors import ProblemError
from kmpc_lite.option_fields import check, seconds, share


@dataclass(frozen=True, slots=True)
class AdaptationOptions:
    """How fast, and how far, adaptation corrects a model; times are in the robot's units [s]."""

    window: float = seconds(2.0, zero=False)
    """Length of the newest drive in which a change is looked for: 20 steps of 0.1 s determine gains
    well enough to predict 1 s ahead."""
    memory: float = seconds(30.0, zero=False)
    """Memory of the slow estimate: short enough to follow a floor that wears."""
    window_alarm: float = share(40.0, zero=False)
    """Squared distance, in standard errors over the gains, between the window's estimate and the
    gains in use that counts as a change. Chance alone gives 4, but few steps are heavy-tailed."""
    memory_alarm: float = share(30.0, zero=False)
    """The same for the slow estimate."""
    least_gain: float = share(0.2, zero=False)
    """A floor leaves at least this share of a commanded speed or turn: mud or ice that takes more
    is no floor to drive on."""
    largest_gain: float = share(2.5, zero=False)
    """No robot drives farther than its model says by more: even a log driven at half the speed
    explains only a factor of two."""

    def __post_init__(self) -> None:
        check(self)
        for expected, holds in (
            ("window < memory", self.window < self.memory),
            ("least_gain < 1 < largest_gain", self.least_gain < 1.0 < self.largest_gain),
        ):
            if not holds:
                raise ProblemError(f"AdaptationOptions: expected {expected}, got {self}")
