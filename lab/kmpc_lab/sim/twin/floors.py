"""What is under the wheels: tile, carpet, a wet patch; and when that changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.errors import ScenarioError
from kmpc_lite.types import Array


@dataclass(frozen=True)
class Floor:
    """How a floor holds a tyre, and how it brakes it.

    A skid-steer robot turns by sliding: with wheels at (+-a, +-b) and tyres of contact radius p the
    sliding forces balance at a share of the turn that the wheels say, b^2 / (a^2 + b^2) = 0.77 for
    p = 0 and less the larger p is.
    """

    sliding: float
    """Coefficient of friction."""
    patch_radius: float
    """Of the tyre's contact: the moment that resists spinning on the spot is sliding * patch_radius
    * load [m]."""
    rolling: float
    """Moment that brakes each wheel, from its axle and from the carpet's pile [N m]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("sliding", "patch_radius", "rolling"):
            value = getattr(self, name)
            if not (np.isfinite(value) and 0.0 <= value <= 10.0):
                raise ScenarioError(f"floor: {name}: expected a number from 0 to 10, got {value!r}")


FLOORS: Mapping[str, Floor] = {
    # the robot makes 0.60 to 0.74 of a turn, less the faster; the maker's 1/1.36 to 1/1.45 on an
    # office floor (diff_drive_controller.yaml)
    "tile": Floor(sliding=0.7, patch_radius=0.006, rolling=0.002),
    # tyres sink in: they slide less, stand on a larger patch, and roll against the pile; 0.44 to
    # 0.54 of a turn
    "carpet": Floor(sliding=1.0, patch_radius=0.025, rolling=0.02),
    # water on tile: 0.76 of a turn, wheels spin, and the robot drifts outwards in curves
    "wet": Floor(sliding=0.2, patch_radius=0.006, rolling=0.002),
}
"""The floors that scenarios name; ours, chosen before any controller drove on them."""


@dataclass(frozen=True)
class Patch:
    """A round piece of another floor: centre and radius [m]."""

    floor: Floor
    x: float
    y: float
    radius: float


@dataclass(frozen=True)
class Ground:
    """The floor at each place and time."""

    floor: Floor = FLOORS["tile"]
    changes: tuple[tuple[float, Floor], ...] = ()
    """From these times on [s since the plant began] the whole floor is another one."""
    patches: tuple[Patch, ...] = field(default=())
    """Lie on top, whatever the floor."""

    def __post_init__(self) -> None:
        """Check the order of the changes."""
        times = [time for time, _ in self.changes]
        if times != sorted(set(times)):
            raise ScenarioError(f"floor changes: expected rising times, got {times}")

    @classmethod
    def named(
        cls,
        floor: str,
        changes: tuple[tuple[float, str], ...] = (),
        patches: tuple[tuple[str, float, float, float], ...] = (),
    ) -> Ground:
        """Build it from the words of a scenario; ScenarioError for a floor that nobody knows."""
        return cls(
            find_floor(floor),
            tuple((t, find_floor(n)) for t, n in changes),
            tuple(Patch(find_floor(n), x, y, r) for n, x, y, r in patches),
        )

    def base(self, time: float) -> Floor:
        """Floor without the patches at a time [s]."""
        return next(
            (floor for start, floor in reversed(self.changes) if time >= start - 1e-9), self.floor
        )

    def under(self, positions: Array, time: float) -> list[Floor]:
        """Floor under each of the positions (n, 2) [m]."""
        base = self.base(time)
        found = [base] * len(positions)
        for patch in self.patches:
            inside = np.hypot(positions[:, 0] - patch.x, positions[:, 1] - patch.y) <= patch.radius
            found = [
                patch.floor if hit else floor for hit, floor in zip(inside, found, strict=True)
            ]
        return found


def find_floor(name: str) -> Floor:
    """Give a floor by its name."""
    if name not in FLOORS:
        raise ScenarioError(f"floor: expected one of {', '.join(FLOORS)}, got {name!r}")
    return FLOORS[name]
