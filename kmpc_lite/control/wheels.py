"""What a robot's wheels let it do: drive and turn on the spot, steer like a car, or go sideways.

They enter a step in three places, and nowhere else: as rows of the QP (`nmpc/qp.py`), as the set of
admissible commands (`NavigationProblem.within_bounds`, of the safe motion), and as the planner's
motions (`path/motions.py`). Each kind says

- `turns_on_the_spot`: whether it can turn where it stands;
- `follows_poses`: whether paths are driven pose by pose, not as lines between turns on the spot;
- `reverse`: whether it may drive backwards;
- `axes`: which of speed and turn rate each number of a command is; `inputs`: how many there are.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from kmpc_lite.control.input_checks import scalar
from kmpc_lite.errors import ProblemError
from kmpc_lite.geometry import seen_along
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array


class Unsteered:
    """Wheels that do any command at once: they need not be steered first."""

    axes: ClassVar[tuple[int, ...]] = (0, 1)
    inputs: ClassVar[int] = 2
    curvature: ClassVar[float] = math.inf  # largest curvature [1/m]

    def within(self, commands: Array) -> Array:
        """Bring commands (..., m) within what the wheels can do: all is."""
        return commands

    def steering_time(self, now: float, reference: Array, dt: float) -> float:
        """How long the wheels take to be turned for a reference [s]: they need not."""
        return 0.0

    def ramped(self, rates: Array) -> tuple[Self, Array]:
        """Give itself, and the fastest changes (inputs,) of its commands where its ramps are so."""
        return self, rates if len(rates) == self.inputs else rates[list(self.axes)]

    def in_units(self, scale: Scale) -> Self:
        """Give the same in a robot's units."""
        return self


@dataclass(frozen=True)
class Differential(Unsteered):
    """Wheels on either side: the robot drives along its heading, and turns on the spot."""

    turns_on_the_spot, follows_poses, reverse = True, False, True


CORRECTION = 0.25
"""How far from the curvature of its reference a car steers to correct, as a share of the largest.
"""
CREEP = 0.003  # speed at which a car steers where it waits, in the robot's units [m/s]


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
        from lock to lock. If not given, at once.
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
    turns_on_the_spot, follows_poses = False, True
    axes, inputs = (0, 1), 2

    def __post_init__(self) -> None:
        scalar("wheels: turning_radius", self.turning_radius, above_zero=True)
        if self.steering_rate is not None:
            scalar("wheels: steering_rate", self.steering_rate, above_zero=True)

    @property
    def curvature(self) -> float:
        """Largest curvature [1/m]."""
        return 1.0 / self.turning_radius

    def within(self, commands: Array) -> Array:
        """Bring commands (..., 2) within what the wheels can do: a car that stands cannot turn."""
        out, sharpest = commands.copy(), self.curvature * np.abs(commands[..., 0])
        out[..., 1] = np.minimum(np.maximum(commands[..., 1], -sharpest), sharpest)
        return out

    def commands(self, reference: Array, now: float, dt: float) -> Array:
        """Commands (N, 2) along a reference (N + 1, 3) of poses, from a curvature now [1/m]."""
        commands = _commands_along(reference, dt)
        if self.steering_rate is not None:
            steered, step = self._steered_along(commands, dt), self.steering_rate * dt
            for k in range(len(steered)):
                now = steered[k] = min(max(steered[k], now - step), now + step)
            commands[:, 1] = commands[:, 0] * steered
        return commands

    def _steered_along(self, commands: Array, dt: float) -> Array:
        """Curvatures (N,) of commands (N, 2), which may jump, as the wheels can be turned.

        Half of each turn comes before its jump and half after it: so the car comes out where the
        path leads.
        """
        speed, turn_rate = commands.T
        drives = np.flatnonzero(np.abs(speed) > CREEP)
        if not len(drives) or self.steering_rate is None:
            return np.zeros(len(commands))
        stages = np.arange(len(commands))
        # what waits is steered as what is driven before it, or next
        nearest = drives[np.maximum(np.searchsorted(drives, stages, "right") - 1, 0)]
        wanted = turn_rate[nearest] / speed[nearest]
        jumps = np.diff(wanted)
        lasts = np.maximum(np.abs(jumps) / (self.steering_rate * dt), 1e-9)
        shares = np.clip(0.5 + (stages[:, None] - stages[1:] + 0.5) / lasts, 0.0, 1.0)
        out: Array = wanted[0] + shares @ jumps
        return out

    def steering_time(self, now: float, reference: Array, dt: float) -> float:
        """How long the wheels take from a curvature to the one that a reference begins in [s]."""
        if self.steering_rate is None:
            return 0.0
        commands = _commands_along(reference, dt)
        if not (np.abs(commands[:, 0]) > CREEP).any():
            return 0.0
        return abs(float(self._steered_along(commands, dt)[0]) - now) / self.steering_rate

    def waits(self, commands: Array) -> int:
        """For how many stages a reference's commands (N, 2) wait until the wheels are turned."""
        drives = np.abs(commands[:, 0]) > CREEP
        return int(drives.argmax()) if self.steering_rate is not None else 0

    def curvatures(self, commands: Array, now: float, dt: float) -> Array:
        """Least and largest curvature (2, N) that plans may steer near commands (N, 2), from now.

        Those to which the wheels can be steered by each stage; and a plan that jumped from one side
        to the other on its way would begin to turn the wheels too late.
        """
        sharpest = self.curvature
        if self.steering_rate is None:
            return sharpest * np.repeat([[-1.0], [1.0]], len(commands), axis=1)
        speed, turn_rate = commands.T
        change = self.steering_rate * dt * np.arange(1, len(commands) + 1)
        drives = np.abs(speed) > CREEP
        near = np.where(drives, turn_rate / np.where(drives, speed, 1.0), 0.0)
        near_by = np.where(drives, CORRECTION * sharpest, 2.0 * sharpest)
        least = np.maximum(now - change, near - near_by)
        most = np.minimum(now + change, near + near_by)
        out: Array = np.clip(np.stack([least, most]), -sharpest, sharpest)
        return out

    def steered(self, commands: Array, wanted: Array, now: float, dt: float) -> Array:
        """Let a car that waits creep at the head of a plan (N, 2) until its wheels are turned.

        To the curvature in which the reference's commands (N, 2) drive on, for wheels that stand
        still tell nothing.
        """
        first = self.waits(wanted)
        if self.steering_rate is None or not first:
            return commands
        out, (speed, turn_rate) = commands.copy(), wanted[first]
        change = self.steering_rate * dt * np.arange(1, first + 1)
        least = np.maximum(now - change, -self.curvature)
        most = np.minimum(now + change, self.curvature)
        out[:first, 0] = math.copysign(CREEP, speed)
        out[:first, 1] = out[:first, 0] * np.clip(turn_rate / speed, least, most)
        return out

    def gears(self, reference: Array, here: Array, last: Array, braking: float) -> Array:
        """Gear of each stage (N,), 1 or -1, that a reference (N + 1, 3) is followed in.

        Parameters
        ----------
        reference : ndarray
            Poses, none of them beyond a change of gear.
        here : ndarray
            The car's pose (3,).
        last : ndarray
            Command (2,) sent last: what rolls stops first.
        braking : float
            How much its speed shrinks in a period, in that of the command.
        """
        steps = np.diff(reference[:, :2], axis=0)
        ahead = (steps * _directions(reference[:-1, 2])).sum()
        if abs(ahead) < 1e-9 * self.turning_radius:
            # it has come to where it stops: what is left may lie before or behind it
            ahead = (reference[-1, :2] - here[:2]) @ _directions(here[2])
        gear = 1.0 if ahead >= 0.0 or not self.reverse else -1.0
        gears = np.full(len(steps), gear)
        if gear * last[0] < 0.0:
            gears[: math.ceil(abs(last[0]) / max(braking, 1e-9) - 1e-9)] = -gear
        return gears

    def ramped(self, rates: Array) -> tuple[Car, Array]:
        """Give itself, and the fastest changes (inputs,) of its commands where its ramps are so.

        The second ramp is that of the curvature: it limits how fast the wheels are steered.
        """
        given = math.inf if self.steering_rate is None else self.steering_rate
        wheels = replace(self, steering_rate=float(rates[1])) if rates[1] < given else self
        return wheels, np.array((rates[0], math.inf))

    def in_units(self, scale: Scale) -> Car:
        """Give the same in a robot's units."""
        rate = self.steering_rate
        return replace(
            self,
            turning_radius=self.turning_radius / scale.length,
            steering_rate=None if rate is None else rate * scale.length * scale.time,
        )


@dataclass(frozen=True)
class Omni(Unsteered):
    """Wheels that roll sideways, too: commands are (v_x, v_y, omega)."""

    turns_on_the_spot, follows_poses, reverse = True, True, True
    axes, inputs = (0, 0, 1), 3


def _commands_along(reference: Array, dt: float) -> Array:
    """Commands (N, 2) that lead from pose to pose of a reference (N + 1, 3), by arcs."""
    steps, turns = np.diff(reference, axis=0), np.diff(reference[:, 2])
    chords = seen_along(steps, reference[:-1, 2] + 0.5 * turns)[:, 0]
    out: Array = np.stack([chords / np.sinc(0.5 * turns / np.pi), turns], axis=1) / dt
    return out


def _directions(headings: Array) -> Array:
    """Unit vectors (..., 2) along headings (...)."""
    return np.stack([np.cos(headings), np.sin(headings)], axis=-1)


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


def wheels_to_table(wheels: Wheels) -> dict[str, Any]:
    """Undo `read_wheels`: kind, and what was given.

    Examples
    --------
    >>> wheels_to_table(Car(0.6))
    {'kind': 'car', 'turning_radius': 0.6, 'reverse': True}
    """
    kind = next(name for name, cls in KINDS.items() if isinstance(wheels, cls))
    given = {key: value for key, value in asdict(wheels).items() if value is not None}
    return {"kind": kind, **given}
