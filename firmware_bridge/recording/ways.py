"""How each kind of wheels is driven at random, and back towards the middle of a fence."""

from __future__ import annotations

import math
import random
from typing import NamedTuple

from firmware_bridge.messages import STILL, Speeds
from firmware_bridge.wheels import Wheels

LEAST = 0.3
"""Share of its speed at which a car at least drives while it turns towards the middle."""
OTHER_END = 2.0
"""A car drives on with the end that it began with until that points this far from the middle [rad].
"""
TIGHT = (0.5, 1.0)
"""Shares of its speed at which a car shows its tightest turn: `kmpc run` turns no faster."""


class Fastest(NamedTuple):
    """Largest speeds [m/s, rad/s]."""

    forward: float
    back: float
    turn: float
    aside: float

    def to(self, sign: float) -> float:
        """Forward or back."""
        return self.forward if sign > 0 else self.back


class Place(NamedTuple):
    """Where a robot is, seen from the middle."""

    x: float
    """[m]"""
    y: float
    theta: float
    """[rad]"""
    half: tuple[float, float]
    """How far from the middle it turns back [m]."""

    def off(self, leading: float) -> float:
        """Angle from a direction to that of the middle [rad]."""
        return math.remainder(math.atan2(-self.y, -self.x) - leading, math.tau)

    def goes_out(self, leading: float) -> bool:
        """Whether that direction leads farther out, where it is out already."""
        ways = zip((self.x, self.y), self.half, (math.cos(leading), math.sin(leading)), strict=True)
        return any(abs(p) > h and p * way > 0.0 for p, h, way in ways)


class Ways:
    """Wheels on either side: each speed by itself.

    `wheels`: of the robot.
    """

    room = 0.0
    """What turning back takes beside braking [m]."""

    def __init__(self, wheels: Wheels) -> None:
        self._radius = wheels.radius

    def draw(self, draw: random.Random, signs: tuple[int, int], fastest: Fastest) -> Speeds:
        """Speeds at random, of a scenario's signs."""
        v = signs[0] * draw.uniform(0.0, fastest.to(signs[0]))
        return v, signs[1] * draw.uniform(0.0, fastest.turn), 0.0

    def shown(
        self, draw: random.Random, signs: tuple[int, int], fastest: Fastest
    ) -> tuple[Speeds, ...]:
        """What random speeds hardly ever hold: a turn on the spot."""
        return ((0.0, signs[1] * fastest.turn * draw.uniform(0.6, 1.0), 0.0),)

    def back(self, place: Place, sign: int, fastest: Fastest, gain: float, begins: bool) -> Speeds:
        """Turn the end that leads towards the middle, and drive as far as it points there."""
        leading = place.theta if sign > 0 else place.theta + math.pi
        off = place.off(leading)
        omega = max(-fastest.turn, min(fastest.turn, gain * off))
        v = 0.0 if place.goes_out(leading) else sign * fastest.to(sign) * max(0.0, math.cos(off))
        return v, omega, 0.0


class CarWays(Ways):
    """A car: it turns while it drives, and goes back with the end that points to the middle."""

    def __init__(self, wheels: Wheels) -> None:
        super().__init__(wheels)
        self._end = 1
        self.room = 0.0 if wheels.reverse else 2.0 * wheels.radius

    def _sharpest(self, v: float, fastest: Fastest) -> float:
        return min(fastest.turn, abs(v) / self._radius)

    def draw(self, draw: random.Random, signs: tuple[int, int], fastest: Fastest) -> Speeds:
        """Speeds at random, of a scenario's signs, in a curve that the wheels can be steered to."""
        v = signs[0] * draw.uniform(0.0, fastest.to(signs[0]))
        return v, signs[1] * draw.uniform(0.0, self._sharpest(v, fastest)), 0.0

    def shown(
        self, draw: random.Random, signs: tuple[int, int], fastest: Fastest
    ) -> tuple[Speeds, ...]:
        """What random speeds hardly ever hold: the tightest turn, slowly and fast."""
        speeds = [signs[0] * share * fastest.to(signs[0]) for share in TIGHT]
        return tuple((v, signs[1] * self._sharpest(v, fastest), 0.0) for v in speeds)

    def back(self, place: Place, sign: int, fastest: Fastest, gain: float, begins: bool) -> Speeds:
        """Steer towards the middle, in the gear in which it lies ahead."""
        off = place.off(place.theta)
        ahead = off if self._end > 0 else math.remainder(off + math.pi, math.tau)
        if fastest.back == 0.0:
            self._end = 1
        elif begins or abs(ahead) > OTHER_END:
            self._end = 1 if abs(off) <= 0.5 * math.pi else -1
        off = off if self._end > 0 else math.remainder(off + math.pi, math.tau)
        v = self._end * fastest.to(self._end) * max(LEAST, math.cos(off))
        most = self._sharpest(v, fastest)
        return v, max(-most, min(most, gain * off)), 0.0


class OmniWays(Ways):
    """An omni: three speeds, and straight back to the middle however it stands."""

    def draw(self, draw: random.Random, signs: tuple[int, int], fastest: Fastest) -> Speeds:
        """Speeds at random, of a scenario's signs; sideways to either side."""
        v, omega, _ = super().draw(draw, signs, fastest)
        return v, omega, draw.uniform(-fastest.aside, fastest.aside)

    def shown(
        self, draw: random.Random, signs: tuple[int, int], fastest: Fastest
    ) -> tuple[Speeds, ...]:
        """What random speeds hardly ever hold: a turn on the spot, and a dash to the side."""
        aside = 0.0, 0.0, signs[1] * fastest.aside
        return (*super().shown(draw, signs, fastest), STILL, aside, STILL)

    def back(self, place: Place, sign: int, fastest: Fastest, gain: float, begins: bool) -> Speeds:
        """Drive to the middle."""
        off = place.off(place.theta)
        v, vy = math.cos(off), math.sin(off)
        most = min(fastest.to(v) / max(abs(v), 1e-9), fastest.aside / max(abs(vy), 1e-9))
        return most * v, 0.0, most * vy


WAYS = {"differential": Ways, "car": CarWays, "omni": OmniWays}
"""By kind of wheels."""
