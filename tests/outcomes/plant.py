"""The robot as it is: it shares no code with the controller's prediction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
LOOKS = 10  # sub-samples of a period at which contacts are looked for


class Moves(Protocol):
    """The true robot, as a drive needs it."""

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (n, 3) during one period from a pose (3,)."""


@dataclass(frozen=True)
class Body:
    """What a robot's motors, wheels and floor are like."""

    slip: float = 0.0  # mean of the exponential slip ratios, drawn anew each period
    gain: tuple[float, float] = (1.0, 1.0)  # shares of commanded speed and turn rate that happen
    turn_loss: float = 0.0
    """Share of its speed that it loses for each rad/s by which it turns [s/rad]."""
    lag: float = 0.0  # time constant of the motors [s]
    dead_time: float = 0.0  # time from a command to the motors' first reaction [s]
    ramp: tuple[float, float] = (math.inf, math.inf)
    """Fastest change of speed and turn rate [m/s^2, rad/s^2]."""
    turning_point: tuple[float, float] = (0.0, 0.0)
    """Turning centre, ahead and left of the pose [m]."""
    draws: float = 0.0
    """Turn that comes with each metre driven [rad/m]: the robot draws to one side."""
    slope: tuple[float, float] = (0.0, 0.0)
    """Velocity at which a slope carries the robot along x and y [m/s]."""
    wheels: tuple[float, float] | None = None
    """Track [m] and fastest wheel [m/s]: both wheels are scaled down together."""
    floors: tuple[tuple[float, float, float], ...] = ()
    """From a time [s] on: slip, and gain of turns."""
    blocked: tuple[float, float] = (0.0, 0.0)
    """From when until when nothing moves, whatever the wheels do [s]."""


class Vehicle:
    """Drives a `Body` by short chords.

    `body`: what it is like. `dt`: period [s]. `seed`: of the slip.
    """

    def __init__(self, body: Body, dt: float, seed: int | Sequence[int]) -> None:
        self._body, self._h = body, dt / LOOKS
        self._random = np.random.default_rng(seed)
        self._speeds, self._sent, self._k = np.zeros(2), [np.zeros(2)], 0

    def drive(self, pose: Array, command: Array) -> Array:
        """Poses (LOOKS, 3) during one period from a pose (3,)."""
        body, h = self._at_time(), self._h
        waiting = round(body.dead_time / h)
        self._sent += [np.array(command, dtype=float)] * LOOKS
        ratios = self._random.exponential(1.0, 3) * body.slip
        poses = np.empty((LOOKS, 3))
        for i in range(LOOKS):
            back = waiting + LOOKS - i
            asked = self._sent[-back] if back <= len(self._sent) else np.zeros(2)
            self._speeds = self._follow(body, asked, h)
            self._k += 1
            begin, end = body.blocked
            if not begin <= self._k * h < end:
                pose = _moved(pose, self._speeds * body.gain, ratios, body, h)
            poses[i] = pose
        del self._sent[: max(len(self._sent) - waiting - LOOKS - 1, 0)]
        return poses

    def _at_time(self) -> Body:
        """The body on the floor of now."""
        body, time = self._body, self._k * self._h
        for begin, slip, gain in body.floors:
            if time >= begin - 1e-9:
                body = replace(body, slip=slip, gain=(body.gain[0], gain))
        return body

    def _follow(self, body: Body, asked: Array, h: float) -> Array:
        """Speeds of the motors a time [s] later."""
        if body.wheels is not None:
            track, fastest = body.wheels
            outer = abs(asked[0]) + 0.5 * track * abs(asked[1])
            asked = asked * min(1.0, fastest / max(outer, 1e-12))
        share = 1.0 - math.exp(-h / body.lag) if body.lag else 1.0
        most = np.array(body.ramp) * h
        speeds: Array = self._speeds + np.clip(share * (asked - self._speeds), -most, most)
        return speeds


def _moved(pose: Array, speeds: Array, ratios: Array, body: Body, h: float) -> Array:
    """Pose (3,) after a time [s] at these speeds."""
    v, omega = speeds.tolist()
    v *= 1.0 - body.turn_loss * abs(omega)
    turn = (omega * (1.0 + ratios[2]) + body.draws * v) * h
    forward, left = v * (1.0 + ratios[0]) * h, -v * ratios[1] * h
    forward += turn * body.turning_point[1]
    left -= turn * body.turning_point[0]
    middle = pose[2] + 0.5 * turn
    cos, sin = math.cos(middle), math.sin(middle)
    x = pose[0] + forward * cos - left * sin + body.slope[0] * h
    y = pose[1] + forward * sin + left * cos + body.slope[1] * h
    return np.array([x, y, pose[2] + turn])
