"""Units of the robot: what makes the same drive, scaled, the same numbers.

Lengths are divided by L = radius / 0.15 m, speeds by V = fastest / 0.6 m/s, times by T = L / V, so
that every robot looks to the controller like the paper's: 0.15 m and 0.6 m/s. Conversion happens
once, at the border. For powers of two it is exact, so the drive is equal to the last bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from kmpc_lite.types import Array

UNIT_RADIUS = 0.15  # radius of the robot that is its own unit [m]: the paper's
UNIT_SPEED = 0.6  # its fastest speed [m/s]
SLOWEST = 50.0  # largest and, inverted, least unit of time that is believed in [s]


@dataclass(frozen=True)
class Scale:
    """How long, and how fast, one unit of a robot is.

    `length`: l: metres of one unit of length. `speed`: v: metres per second of one unit of speed.
    `inputs`: numbers of a command: m.

    Examples
    --------
    >>> husky = Scale.of_robot(radius=0.5, fastest=1.0)
    >>> round(husky.time, 2)
    2.0
    """

    length: float = 1.0
    speed: float = 1.0
    inputs: int = 2

    @classmethod
    def of_robot(cls, radius: float, fastest: float, inputs: int = 2) -> Scale:
        """Scale of a robot with a radius [m] and a fastest speed [m/s]; zero counts as the unit.

        A robot that takes longer than `SLOWEST` units of time to drive a unit of length, or hardly
        any, is no robot: it gets units in which numbers stay usable.
        """
        length = radius / UNIT_RADIUS if radius > 0.0 else 1.0
        speed = fastest / UNIT_SPEED if fastest > 0.0 else length
        return cls(length, min(max(speed, length / SLOWEST), length * SLOWEST), inputs)

    @property
    def time(self) -> float:
        """T: seconds of one unit of time."""
        return self.length / self.speed

    @property
    def is_one(self) -> bool:
        """Whether the robot's units are metres and seconds."""
        return self.length == 1.0 and self.speed == 1.0

    @cached_property
    def state(self) -> Array:
        """Factors (3,) from a pose in units to one in [m, m, rad]."""
        return np.array((self.length, self.length, 1.0))

    @cached_property
    def command(self) -> Array:
        """Factors (m,) from a command in units to one in [m/s, rad/s], the turn rate last."""
        return np.array([self.speed] * (self.inputs - 1) + [1.0 / self.time])

    @cached_property
    def acceleration(self) -> Array:
        """Factors (2,) from a change of command in units to one in [m/s^2, rad/s^2]."""
        return self.command / self.time

    @cached_property
    def circle(self) -> Array:
        """Factors (5,) from a circle's row in units to x, y, radius [m], vx, vy [m/s]."""
        return np.array((self.length, self.length, self.length, self.speed, self.speed))
