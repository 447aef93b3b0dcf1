"""Body speeds <-> speeds of wheels on either side, of a car, or of an omni; how cars steer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from firmware_bridge.messages import ConfigError, Speeds
from firmware_bridge.options import bounded, check, is_number

Row = tuple[float, float, float]
"""Rim speed of a wheel [m/s] for each 1 of v [m/s], omega [rad/s] and vy [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Geometry:
    """Wheels, each on its own motor: what all kinds share."""

    wheel_radius: float = bounded(1e-3, 10.0, "m")  # [m]
    max_wheel_speed: float = bounded(1e-3, 100.0, "m/s")
    """At the rim [m/s]. Faster commands are scaled down on all wheels, which keeps the
    curvature."""
    gear_ratio: float = bounded(1e-3, 1e4, "", 1.0)  # motor turns per wheel turn

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the wheels, in their order."""
        raise NotImplementedError

    @property
    def rows(self) -> tuple[Row, ...]:
        """How each wheel turns with the body."""
        raise NotImplementedError

    @property
    def signs(self) -> tuple[float, ...]:
        """-1 for each motor that turns backwards for positive commands, else 1."""
        raise NotImplementedError

    @property
    def still(self) -> tuple[float, ...]:
        """Wheels that stand."""
        return (0.0,) * len(self.names)

    @cached_property
    def _squares(self) -> list[float]:
        return [sum(row[axis] ** 2 for row in self.rows) for axis in range(3)]

    def wheels(self, v: float, omega: float, vy: float = 0.0) -> tuple[float, ...]:
        """Wheel speeds [rad/s] for v [m/s], omega [rad/s] and an omni's vy [m/s].

        Beyond the limit all are scaled, so that the curvature stays.

        Raises ValueError if a speed is not finite.
        """
        if not all(map(math.isfinite, (v, omega, vy))):
            raise ValueError(f"expected finite speeds, got v = {v}, omega = {omega}, vy = {vy}")
        # so that nothing overflows on its way to the limit
        huge = max(abs(v), abs(omega), abs(vy), 1e6) / 1e6
        v, omega, vy = v / huge, omega / huge, vy / huge
        rims = [ahead * v + turn * omega + left * vy for ahead, turn, left in self.rows]
        largest = max(map(abs, rims))
        scale = self.max_wheel_speed / largest if largest > self.max_wheel_speed else 1.0
        return tuple(rim * scale / self.wheel_radius for rim in rims)

    def body(self, wheels: tuple[float, ...], curvature: float = 0.0) -> Speeds:
        """Body speeds of wheel speeds [rad/s]; of a car, in a curvature [1/m]."""
        v, omega, vy = (
            self.wheel_radius
            * sum(row[axis] * wheel for row, wheel in zip(self.rows, wheels, strict=True))
            / square
            if square
            else 0.0
            for axis, square in enumerate(self._squares)
        )
        return v, omega, vy

    def to_channels(self, *wheels: float) -> tuple[float, ...]:
        """Motor turns per second of the board's channels, from wheel speeds [rad/s]."""
        factor = self.gear_ratio / math.tau
        return tuple(factor * s * wheel for s, wheel in zip(self.signs, wheels, strict=True))

    def from_channels(self, *channels: float) -> tuple[float, ...]:
        """Wheels [rad or rad/s] from motor turns (per second) of the channels."""
        factor = math.tau / self.gear_ratio
        return tuple(factor * s * turns for s, turns in zip(self.signs, channels, strict=True))


@dataclass(frozen=True, kw_only=True)
class WheelGeometry(Geometry):
    """A robot with a left and a right wheel (or side), each on its own motor.

    Examples
    --------
    >>> rosbot = WheelGeometry(wheel_radius=0.0425, track=0.27, max_wheel_speed=0.9)
    >>> v, omega, _ = rosbot.body(rosbot.wheels(0.4, 1.0))
    >>> round(v, 9), round(omega, 9)
    (0.4, 1.0)
    """

    track: float = bounded(1e-2, 100.0, "m")
    """Effective distance between the wheels [m]; skid-steer robots: 1.3 to 2 times the measured
    one."""
    invert_left: bool = False  # the left motor turns backwards for positive commands
    invert_right: bool = False
    swap: bool = False  # the right wheel is on the board's first channel

    def __post_init__(self) -> None:
        """Check the ranges, and that no wheel seems to be given in centimetres."""
        super().__post_init__()
        if self.wheel_radius > self.track:
            raise ConfigError(
                f"wheel_radius: expected at most the track of {self.track:g} m, "
                f"got {self.wheel_radius:g} m"
            )

    names = "left", "right"

    @property
    def rows(self) -> tuple[Row, ...]:
        """How each wheel turns with the body."""
        return (1.0, -self.track / 2.0, 0.0), (1.0, self.track / 2.0, 0.0)

    @property
    def signs(self) -> tuple[float, ...]:
        """-1 for each motor that turns backwards for positive commands, else 1."""
        return (-1.0 if self.invert_left else 1.0), (-1.0 if self.invert_right else 1.0)

    def to_channels(self, *wheels: float) -> tuple[float, ...]:
        """Motor turns per second of the board's channels, from wheel speeds [rad/s]."""
        channels = super().to_channels(*wheels)
        return channels[::-1] if self.swap else channels

    def from_channels(self, *channels: float) -> tuple[float, ...]:
        """Wheels [rad or rad/s] from motor turns (per second) of the channels."""
        return super().from_channels(*(channels[::-1] if self.swap else channels))


def curvature_of(v: float, omega: float, sharpest: float, before: float = 0.0) -> float:
    """Curvature [1/m] to which a command [m/s, rad/s] steers a car's wheels, at most the sharpest.

    A command to stand leaves them as they are (`before`); one to turn where the car stands steers
    them to that side, as does any that asks for a sharper curve than they can be steered to.
    """
    if v == omega == 0.0:
        return before
    if abs(omega) < sharpest * abs(v):
        return omega / v
    return math.copysign(sharpest, omega if v >= 0.0 else -omega)


@dataclass(frozen=True, kw_only=True)
class CarGeometry(Geometry):
    """A car: one motor drives the rear axle, a servo steers the front wheels.

    Examples
    --------
    >>> car = CarGeometry(wheel_radius=0.05, max_wheel_speed=2.0, wheelbase=0.26,
    ...                   steering_angle=0.4)
    >>> [round(car.angle(car.steer(*command)), 3) for command in ((1.0, 0.5), (0.0, 0.5))]
    [0.129, 0.4]
    """

    wheelbase: float = bounded(1e-2, 100.0, "m")  # distance between the axles [m]
    steering_angle: float = bounded(1e-2, 1.5, "rad")
    """Largest angle of the front wheels, to either side [rad]."""
    steering_rate: float | None = bounded(1e-3, 1e3, "1/m/s", None)
    """How fast the curvature can change [1/m per second]; at once if not given."""
    invert: bool = False  # the motor turns backwards for positive commands

    names = ("driven",)
    rows = ((1.0, 0.0, 0.0),)

    @property
    def signs(self) -> tuple[float, ...]:
        """-1 for a motor that turns backwards for positive commands, else 1."""
        return (-1.0 if self.invert else 1.0,)

    @property
    def sharpest(self) -> float:
        """Largest curvature [1/m]."""
        return math.tan(self.steering_angle) / self.wheelbase

    def body(self, wheels: tuple[float, ...], curvature: float = 0.0) -> Speeds:
        """Body speeds of the driven axle's speed [rad/s] in a curvature [1/m]."""
        v = self.wheel_radius * wheels[0]
        return v, v * curvature, 0.0

    def steer(self, v: float, omega: float, before: float = 0.0) -> float:
        """Curvature [1/m] to which a command [m/s, rad/s] steers the wheels: `curvature_of`."""
        return curvature_of(v, omega, self.sharpest, before)

    def angle(self, curvature: float) -> float:
        """Angle of the front wheels [rad], to the left, in a curvature [1/m]."""
        return math.atan(self.wheelbase * curvature)


@dataclass(frozen=True, kw_only=True)
class OmniGeometry(Geometry):
    """Four mecanum wheels (`track`, `wheelbase`), or three or four omni wheels on arms (`arm`).

    Mecanum wheels are front left, front right, rear left, rear right, and their rollers form an X,
    seen from above. Omni wheels stand evenly around the middle: from the front left on,
    counter-clockwise, and each drives counter-clockwise.

    Examples
    --------
    >>> cart = OmniGeometry(wheel_radius=0.05, max_wheel_speed=1.0, track=0.3, wheelbase=0.3)
    >>> [round(speed, 9) for speed in cart.wheels(0.0, 0.0, 0.2)]
    [-4.0, 4.0, 4.0, -4.0]
    """

    track: float | None = bounded(1e-2, 100.0, "m", None)
    """Distance between left and right mecanum wheels [m]."""
    wheelbase: float | None = bounded(1e-2, 100.0, "m", None)
    """Distance between front and rear mecanum wheels [m]."""
    arm: float | None = bounded(1e-2, 100.0, "m", None)
    """Distance of omni wheels from the middle [m]."""
    count: int = bounded(3, 4, "wheels", 3)  # of omni wheels
    invert: Any = ()  # numbers of the motors, from 1 on, that turn backwards for positive commands

    def __post_init__(self) -> None:
        """Check the ranges, and that the wheels are of one kind."""
        super().__post_init__()
        if (self.arm is None) == (self.track is None or self.wheelbase is None):
            raise ConfigError(
                "wheels: expected track and wheelbase of mecanum wheels, or arm of omni wheels"
            )
        numbers = self.invert if isinstance(self.invert, list | tuple) else (None,)
        if not all(is_number(n) and n in range(1, len(self.names) + 1) for n in numbers):
            raise ConfigError(
                f"invert: expected numbers of motors, 1 to {len(self.names)}, got {self.invert!r}"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Of the wheels, in their order."""
        if self.arm is None:
            return "front left", "front right", "rear left", "rear right"
        return ("first", "second", "third", "fourth")[: self.count]

    @property
    def rows(self) -> tuple[Row, ...]:
        """How each wheel turns with the body."""
        if self.arm is None:
            assert self.track is not None and self.wheelbase is not None
            turn = (self.track + self.wheelbase) / 2.0
            return (1.0, -turn, -1.0), (1.0, turn, 1.0), (1.0, -turn, 1.0), (1.0, turn, -1.0)
        places = (math.pi * (2 * k + 1) / self.count for k in range(self.count))
        return tuple((-math.sin(place), self.arm, math.cos(place)) for place in places)

    @property
    def signs(self) -> tuple[float, ...]:
        """-1 for each motor that turns backwards for positive commands, else 1."""
        return tuple(-1.0 if k + 1 in self.invert else 1.0 for k in range(len(self.names)))


KINDS: dict[str, type[Geometry]] = {
    "differential": WheelGeometry,
    "car": CarGeometry,
    "omni": OmniGeometry,
}
"""What ``[geometry]`` takes, by kind of wheels."""
