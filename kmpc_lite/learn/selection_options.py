"""How the terms of a model are chosen."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SelectionOptions:
    """How a choice is made."""

    window: float = 1.0
    """Length of the windows that are predicted [s]: about what a plan looks ahead."""
    block: float = 5.0
    """Length of a block [s]: longer than what a disturbance lasts."""
    fewest_blocks: int = 16
    """Short logs are cut into shorter blocks until there are as many."""
    longest: float = 1.0
    """Longest history [s]."""
    most_periods: int = 12
    """Longest history [periods]: each period adds columns to the quadratic program."""
    kept: float = 0.5
    """Share of the windows that must remain after the longest history."""
    significance: float = 0.001
    """Probability at which a worthless explanation may pass, in each direction."""
    most_steps: int = 40_000
    """Steps of the longest log that the choice looks at in full; the fit looks at all."""
    refinements: tuple[float, ...] = (0.5, 0.25, 0.125)
    """Steps by which a chosen response is refined [periods]."""

    def longest_history(self, dt: float) -> int:
        """Longest history at a period [s], in periods."""
        return min(self.most_periods, max(1, round(self.longest / dt)))
