"""What a robot's wheels let it do: drive and turn on the spot, steer like a car, or go sideways.

They enter a step in three places, and nowhere else: as rows of the QP (`nmpc/qp.py`), as the set of
admissible commands (`NavigationProblem.within_bounds`, of the safe motion), and as the planner's
motions (`path/motions.py`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from kmpc_lite.control.problem_fields import scalar
from kmpc_lite.errors import ProblemError
from kmpc_lite.scale import Scale


@dataclass(frozen=True)
class Differential:
    """Wheels on either side: the robot drives along its heading, and turns on the spot."""

    def in_units(self, scale: Scale) -> Differential:
        """Give the same in a robot's units."""
        return self


@dataclass(frozen=True)
class Car:
    """Steered wheels: a car turns only while it drives.

    Parameters
    ----------
    turning_radius : float
        Of the tightest circle on which the tracked pose drives [m]; of a pose at the middle of the
        rear axle, wheelbase over the tangent of the largest steering angle.
    steering_rate : float, optional
        How fast the curvature can change [1/m per second]: twice the largest one, over the time
        from lock to lock. Where not given, at once.
    reverse : bool
        Whether it may drive backwards.

    Raises
    ------
    ProblemError
        For numbers that are not finite and above zero.

    Examples
    --------
    >>> Car(turning_radius=0.6).curvature
    1.6666666666666667
    """

    turning_radius: float
    steering_rate: float | None = None
    reverse: bool = True

    def __post_init__(self) -> None:
        scalar("wheels: turning_radius", self.turning_radius, above_zero=True)
        if self.steering_rate is not None:
            scalar("wheels: steering_rate", self.steering_rate, above_zero=True)

    @property
    def curvature(self) -> float:
        """Largest curvature [1/m]."""
        return 1.0 / self.turning_radius

    def in_units(self, scale: Scale) -> Car:
        """Give the same in a robot's units."""
        rate = self.steering_rate
        return replace(
            self,
            turning_radius=self.turning_radius / scale.length,
            steering_rate=None if rate is None else rate * scale.length * scale.time,
        )


@dataclass(frozen=True)
class Omni:
    """Wheels that roll sideways, too: commands are (v_x, v_y, omega)."""

    def in_units(self, scale: Scale) -> Omni:
        """Give the same in a robot's units."""
        return self


Wheels = Differential | Car | Omni
KINDS = {"differential": Differential, "car": Car, "omni": Omni}


def read_wheels(value: Any) -> Wheels:
    """Read what a file says: a name, or a table of kind and what it takes.

    Examples
    --------
    >>> read_wheels({"kind": "car", "turning_radius": 0.6})
    Car(turning_radius=0.6, steering_rate=None, reverse=True)
    """
    if isinstance(value, Differential | Car | Omni):
        return value
    table = {"kind": value} if isinstance(value, str) else dict(value)
    kind = KINDS.get(table.pop("kind", ""))
    if kind is None:
        raise ProblemError(f"wheels: expected a kind of {', '.join(KINDS)}, got {value!r:.80}")
    try:
        wheels: Wheels = kind(**table)
    except TypeError:
        raise ProblemError(f"wheels: {value!r:.80}: unknown or missing entries") from None
    return wheels
