"""What a robot's wheels let a path be made of: motions at constant speeds, and whole connections.

A twist is a robot's speed ahead, to the left, and round (3,); held for a time it leads along an
arc, a straight line, or a turn on the spot. The field planner grows its tree by a few of them, and
connects poses by as many as `connect` gives, one after the other.

A car's shortest curves are the words of Reeds and Shepp ("Optimal paths for a car that goes both
forwards and backwards", Pacific J. Math. 145, 1990, whose numbers stand beside the formulas): in
turning radii, at most five segments, driven ahead (above zero) or backwards. Sizes: W = 52 words.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np

from kmpc_lite.control.path.planner import PathRequest
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.wheels import Car, Omni, Wheels
from kmpc_lite.geometry import exact_arc, nearest_turn, rotate, seen_along
from kmpc_lite.types import Array

ROUNDING = 1e-10
SEGMENTS = 5
HALF = 0.5 * np.pi
Word = tuple[Array, Array, Array, Array]
"""Lengths t, u, v of a word's segments (n,), and which ends it reaches."""


def _wrapped(angle: Array) -> Array:
    out: Array = np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
    return out


def _root(squares: Array) -> Array:
    out: Array = np.sqrt(np.maximum(squares, 0.0))
    return out


def _lsl(x: Array, y: Array, phi: Array) -> Word:
    """8.1: left, straight, left."""
    dx, dy = x - np.sin(phi), y - 1.0 + np.cos(phi)
    t = np.arctan2(dy, dx)
    v = _wrapped(phi - t)
    return t, np.hypot(dx, dy), v, (t >= -ROUNDING) & (v >= -ROUNDING)


def _lsr(x: Array, y: Array, phi: Array) -> Word:
    """8.2: left, straight, right."""
    dx, dy = x + np.sin(phi), y - 1.0 - np.cos(phi)
    square = dx * dx + dy * dy
    u = _root(square - 4.0)
    t = _wrapped(np.arctan2(dy, dx) + np.arctan2(2.0, u))
    v = _wrapped(t - phi)
    return t, u, v, (square >= 4.0) & (t >= -ROUNDING) & (v >= -ROUNDING)


def _lrl(x: Array, y: Array, phi: Array) -> Word:
    """8.3 and 8.4: left, right backwards, left."""
    dx, dy = x - np.sin(phi), y - 1.0 + np.cos(phi)
    far = np.hypot(dx, dy)
    u = -2.0 * np.arcsin(np.minimum(0.25 * far, 1.0))
    t = _wrapped(np.arctan2(dy, dx) + 0.5 * u + np.pi)
    v = _wrapped(phi - t + u)
    return t, u, v, (far <= 4.0) & (t >= -ROUNDING)


def _outer(u: Array, v: Array, dx: Array, dy: Array, phi: Array) -> tuple[Array, Array]:
    """First and last arc of a word whose two middle arcs are u and v."""
    delta = _wrapped(u - v)
    a, b = np.sin(u) - np.sin(delta), np.cos(u) - np.cos(delta) - 1.0
    angle = np.arctan2(dy * a - dx * b, dx * a + dy * b)
    flips = 2.0 * (np.cos(delta) - np.cos(v) - np.cos(u)) + 3.0 < 0.0
    t = _wrapped(angle + np.pi * flips)
    return t, _wrapped(t - u + v - phi)


def _lrlr_even(x: Array, y: Array, phi: Array) -> Word:
    """8.7: left, right ahead; left, right backwards."""
    dx, dy = x + np.sin(phi), y - 1.0 - np.cos(phi)
    rho = 0.25 * (2.0 + np.hypot(dx, dy))
    u = np.arccos(np.minimum(rho, 1.0))
    t, v = _outer(u, -u, dx, dy, phi)
    return t, u, v, (rho <= 1.0) & (t >= -ROUNDING) & (v <= ROUNDING)


def _lrlr_odd(x: Array, y: Array, phi: Array) -> Word:
    """8.8: left, two arcs backwards, right."""
    dx, dy = x + np.sin(phi), y - 1.0 - np.cos(phi)
    rho = (20.0 - dx * dx - dy * dy) / 16.0
    u = -np.arccos(np.clip(rho, 0.0, 1.0))
    t, v = _outer(u, u, dx, dy, phi)
    return t, u, v, (rho >= 0.0) & (rho <= 1.0) & (t >= -ROUNDING) & (v >= -ROUNDING)


def _lrsl(x: Array, y: Array, phi: Array) -> Word:
    """8.9: left, a quarter right backwards, straight, left."""
    dx, dy = x - np.sin(phi), y - 1.0 + np.cos(phi)
    rho = np.hypot(dx, dy)
    r = _root(rho * rho - 4.0)
    t = _wrapped(np.arctan2(dy, dx) + np.arctan2(r, -2.0))
    v = _wrapped(phi - HALF - t)
    u = 2.0 - r
    return t, u, v, (rho >= 2.0) & (t >= -ROUNDING) & (u <= ROUNDING) & (v <= ROUNDING)


def _lrsr(x: Array, y: Array, phi: Array) -> Word:
    """8.10: left, a quarter right backwards, straight, right."""
    dx, dy = x + np.sin(phi), y - 1.0 - np.cos(phi)
    rho = np.hypot(dx, dy)
    t = np.arctan2(dx, -dy)
    u, v = 2.0 - rho, _wrapped(t + HALF - phi)
    return t, u, v, (rho >= 2.0) & (t >= -ROUNDING) & (u <= ROUNDING) & (v <= ROUNDING)


def _lrslr(x: Array, y: Array, phi: Array) -> Word:
    """8.11: left, a quarter right backwards, straight, a quarter left backwards, right."""
    dx, dy = x + np.sin(phi), y - 1.0 - np.cos(phi)
    rho = np.hypot(dx, dy)
    u = 4.0 - _root(rho * rho - 4.0)
    t = _wrapped(np.arctan2((4.0 - u) * dx - 2.0 * dy, -2.0 * dx + (u - 4.0) * dy))
    v = _wrapped(t - phi)
    return t, u, v, (rho >= 2.0) & (u <= ROUNDING) & (t >= -ROUNDING) & (v >= -ROUNDING)


Formula = Callable[[Array, Array, Array], Word]
# formula, turns of its segments (1 left, -1 right), where t, u, v go, their factors, what is fixed,
# and whether the curve is looked at from its end
FORMULAS: tuple[tuple[Formula, tuple[int, ...], str, bool], ...] = (
    (_lsl, (1, 0, 1, 0, 0), "tuv", False),
    (_lsr, (1, 0, -1, 0, 0), "tuv", False),
    (_lrl, (1, -1, 1, 0, 0), "tuv", False),
    (_lrl, (1, -1, 1, 0, 0), "vut", True),
    (_lrlr_even, (1, -1, 1, -1, 0), "tuUv", False),
    (_lrlr_odd, (1, -1, 1, -1, 0), "tuuv", False),
    (_lrsl, (1, -1, 0, 1, 0), "tquv", False),
    (_lrsl, (1, 0, -1, 1, 0), "vuqt", True),
    (_lrsr, (1, -1, 0, -1, 0), "tquv", False),
    (_lrsr, (-1, 0, -1, 1, 0), "vuqt", True),
    (_lrslr, (1, -1, 0, 1, -1), "tquqv", False),
)
"""Each with the turns of its segments (1 left, -1 right), what their lengths are (U: -u; q: a
quarter backwards), and whether the curve is looked at from its end."""
FLIPS = np.array(((1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)))
"""Each word also driven in the other gears, and mirrored."""
TURNS = np.concatenate([FLIPS[:, 1:] * np.array(turns) for _, turns, _, _ in FORMULAS])
"""(W, 5) turn of each segment: 1 to the left, -1 to the right, 0 straight."""


def curves(ends: Array) -> Array:
    """Lengths (n, W, 5) of the segments of all words to ends (n, 3), infinite of those not reached.

    `ends`: (n, 3) as seen from where the curves begin [turning radii, rad].
    """
    gear, side = FLIPS.T[..., None]
    x, y, phi = gear * ends[:, 0], side * ends[:, 1], gear * side * ends[:, 2]
    sin, cos = np.sin(phi), np.cos(phi)
    seen_back = x * cos + y * sin, x * sin - y * cos
    out = np.zeros((len(FORMULAS), len(FLIPS), len(ends), SEGMENTS))
    for lengths, (formula, _, parts, backwards) in zip(out, FORMULAS, strict=True):
        t, u, v, reached = formula(*(seen_back if backwards else (x, y)), phi)
        values = {"t": t, "u": u, "U": -u, "v": v, "q": np.full_like(t, -HALF)}
        for k, part in enumerate(parts):
            lengths[..., k] = np.where(reached, gear * values[part], np.inf)
    return np.moveaxis(out.reshape(-1, len(ends), SEGMENTS), 0, 1)


TINY = 1e-9
WIDER = 1.05
"""Paths of a car turn by circles so many times as wide as its tightest one: it must be able to
steer back."""
SLOW_STEERING = 0.2
"""How much wider they are of a car that drives a turning radius while it is steered to one side."""
CURVATURES = np.array((-1.0, -0.5, 0.0, 0.5, 1.0))
"""Of the arcs by which a car's tree grows, as shares of the largest one."""
TURN_SHARE = 0.9  # of the fastest turn rate to a side: the rest is left for corrections
FULL = 2.0 * math.pi


def moved(poses: Array, twists: Array, times: Array) -> Array:
    """Poses (..., 3) after twists (..., 3) were held for times (...)."""
    out: Array = exact_arc(poses, twists[..., 0], twists[..., 2], times, twists[..., 1])
    return out


def seen_from(start: Array, poses: Array) -> Array:
    """Poses (..., 3) in the frame of one (..., 3), their headings in [-pi, pi]."""
    seen = seen_along(poses - start, start[..., 2])
    seen[..., 2] -= nearest_turn(seen[..., 2])
    return seen


def chained(start: Array, twists: Array, times: Array) -> Array:
    """Poses (..., S + 1, 3) at the ends of S twists (..., S, 3) driven one after the other."""
    out = np.empty((*times.shape[:-1], times.shape[-1] + 1, 3))
    out[..., 0, :] = start
    for k in range(times.shape[-1]):
        out[..., k + 1, :] = moved(out[..., k, :], twists[..., k, :], times[..., k])
    return out


def sampled(start: Array, twists: Array, times: Array, counts: Array) -> tuple[Array, Array]:
    """Poses (K, 3) from a start (3,) along S twists, and when they are reached (K,).

    `start`: (3,), the first of them. `twists`, `times`: (S, 3) and (S,). `counts`: (S,) poses on
    each.
    """
    begins = chained(start, twists, times)[:-1]
    piece = np.repeat(np.arange(len(times)), counts)
    first = np.cumsum(counts) - counts
    share = (np.arange(len(piece)) - first[piece] + 1.0) / counts[piece]
    after = share * times[piece]
    poses = moved(begins[piece], twists[piece], after)
    when = (np.cumsum(times) - times)[piece] + after
    return np.concatenate([start[None], poses]), np.concatenate([[0.0], when])


def straight_twist(ends: Array) -> Array:
    """Twists (..., 3) that lead to ends (..., 3), as seen from where they begin, in a unit time."""
    turn = ends[..., 2]
    half = 0.5 * turn
    chord = np.sinc(half / np.pi)
    cos, sin = np.cos(half) / chord, np.sin(half) / chord
    x, y = ends[..., 0], ends[..., 1]
    return np.stack([cos * x + sin * y, cos * y - sin * x, turn], axis=-1)


class Motions(Protocol):
    """Motions of one kind of wheels at the speeds of one request."""

    twists: Array  # (P, 3) by which a tree grows
    gears: Array  # (P,) 1 ahead, -1 backwards, 0 of motions without a gear
    turn: float  # how far one of them should turn at the least [rad]

    def paced(self, twists: Array, times: Array) -> Array:
        """Times (S,) in which S motions (S, 3) can be driven one after the other, and kept to."""

    def steering_times(self, twists: Array, times: Array, now: float | None) -> Array:
        """What steering takes (...) beside the times of motions (..., S, 3), from a curvature now.

        None if it is driven before them, nobody knows in which.
        """

    def connect(self, start: Array, ends: Array) -> tuple[Array, Array]:
        """Twists (n, W, S, 3) and times (n, W, S) of W ways to each of the poses (n, 3).

        From a pose (3,), obstacles aside; infinite times where a way does not lead there.
        """


class CarMotions:
    """Arcs and straights in both gears; curves of Reeds and Shepp, or of Dubins, lead to a pose."""

    def __init__(self, car: Car, request: PathRequest, tight: bool) -> None:
        self._radius = WIDER * car.turning_radius / request.curving
        if not tight:
            # how far it drives until it is steered to one side, in turning radii
            steers = 0.0 if car.steering_rate is None else car.curvature / car.steering_rate
            driven = float(request.forward[0]) * car.curvature * (steers + request.steering_lag)
            self._radius *= 1.0 + SLOW_STEERING * min(driven, 1.0)
        self._steering_rate = car.steering_rate
        self._reverse = car.reverse and float(request.backward[0]) > 0.0
        self._speeds = {1.0: request.forward, -1.0: request.backward}
        gears = (1.0, -1.0) if self._reverse else (1.0,)
        moves = [(self._twists(np.full(len(CURVATURES), g), CURVATURES)) for g in gears]
        self.twists: Array = np.concatenate(moves)
        self.gears: Array = np.sign(self.twists[:, 0])
        self.turn = FULL / 16

    def _twists(self, gears: Array, curvatures: Array) -> Array:
        """Twists (..., 3) of gears (...) along curvatures (...), as shares of the largest one."""
        speeds = np.where(gears > 0.0, *(float(self._speeds[g][0]) for g in (1.0, -1.0)))
        rates = np.where(gears > 0.0, *(float(self._speeds[g][1]) for g in (1.0, -1.0)))
        sharp = np.abs(curvatures) / self._radius
        speeds = np.minimum(speeds, rates / np.maximum(sharp, TINY))
        ahead = gears * speeds
        return np.stack([ahead, np.zeros_like(ahead), ahead * curvatures / self._radius], axis=-1)

    def paced(self, twists: Array, times: Array) -> Array:
        """Times (S,) in which a car can drive motions (S, 3) one after the other, and keep to them.

        It needs time to steer from arc to arc; where its gear changes it steers standing.
        """
        if self._steering_rate is None:
            return times
        speed, turn_rate = twists[:, 0], twists[:, 2]
        needed = np.abs(np.diff(turn_rate / speed)) / self._steering_rate
        needed = np.where(speed[1:] * speed[:-1] > 0.0, needed, 0.0)
        out: Array = times.copy()
        out[1:] = np.maximum(times[1:], needed)
        return out

    def steering_times(self, twists: Array, times: Array, now: float | None) -> Array:
        """Standing where the gear changes or the way begins; on short arcs, beyond their times."""
        out = np.zeros(times.shape[:-1])
        if self._steering_rate is None:
            return out
        driven = (times > TINY) & np.isfinite(times)
        speeds = np.where(driven, twists[..., 0], np.nan)
        curvatures = twists[..., 2] / np.where(twists[..., 0] != 0.0, twists[..., 0], 1.0)
        gear = np.full(out.shape, np.nan)
        before = np.full(out.shape, np.nan if now is None else now)
        for k in range(times.shape[-1]):
            here, ahead = driven[..., k], speeds[..., k]
            needed = np.abs(curvatures[..., k] - before) / self._steering_rate
            rolls = gear * ahead > 0.0
            needed = np.where(rolls, np.maximum(needed - times[..., k], 0.0), needed)
            out += np.where(here & np.isfinite(before), needed, 0.0)
            gear, before = np.where(here, ahead, gear), np.where(here, curvatures[..., k], before)
        return out

    def connect(self, start: Array, ends: Array) -> tuple[Array, Array]:
        """Give the ways of a car: its arcs are as tight as may be."""
        seen = seen_from(start, ends) / (self._radius, self._radius, 1.0)
        lengths = curves(seen)
        turns = np.broadcast_to(TURNS, lengths.shape)
        if not self._reverse:
            # CSC alone, whose arcs may go round by more than a half
            lengths, turns = lengths[:, :8].copy(), turns[:, :8]
            arcs = turns != 0.0
            reached = np.isfinite(lengths).all(axis=-1, keepdims=True)
            lengths = np.where(reached & (np.abs(lengths) > TINY), lengths, 0.0)
            lengths = np.where(arcs, np.mod(lengths, FULL), lengths)
            reached = reached & (lengths >= 0.0).all(axis=-1, keepdims=True)
            lengths = np.where(reached, lengths, np.inf)
        gears = np.where(lengths >= 0.0, 1.0, -1.0)
        twists = self._twists(gears, turns)
        times = np.abs(lengths) * self._radius / np.maximum(np.abs(twists[..., 0]), TINY)
        return twists, times


class Unsteered:
    """Motions between which nothing is steered."""

    def paced(self, twists: Array, times: Array) -> Array:
        """Times (S,) in which motions (S, 3) are driven: as they are."""
        return times

    def steering_times(self, twists: Array, times: Array, now: float | None) -> Array:
        """None."""
        return np.zeros(times.shape[:-1])


class OmniMotions(Unsteered):
    """Eight directions, and turning; straight to a pose, turning before, meanwhile, or after."""

    def __init__(self, request: PathRequest, sideways: float) -> None:
        ahead, rate = request.forward.tolist()
        back = float(request.backward[0])
        self._fastest = np.array((ahead, max(back, TINY), sideways, rate))
        angles = FULL / 8 * np.arange(8)
        directions = np.stack([np.cos(angles), np.sin(angles), np.zeros(8)], axis=1)
        if back <= 0.0:
            directions = directions[directions[:, 0] > -TINY]
        turns = np.array(((0.0, 0.0, 1.0), (0.0, 0.0, -1.0)))
        moves = np.concatenate([directions, turns])
        self.twists: Array = moves / self._time(moves)[:, None]
        self.gears: Array = np.zeros(len(moves))
        self.turn = FULL / 16

    def _time(self, moves: Array) -> Array:
        """Time (...) that moves (..., 3) of the robot take, all at once."""
        x, y, turn = np.moveaxis(moves, -1, 0)
        ahead, back, sideways, rate = self._fastest
        along = np.hypot(np.maximum(x / ahead, -x / back), y / sideways)
        out: Array = np.maximum(np.maximum(along, np.abs(turn) / rate), TINY)
        return out

    def connect(self, start: Array, ends: Array) -> tuple[Array, Array]:
        """Give three ways of two motions each."""
        seen = seen_from(start, ends)
        turn = seen * (0.0, 0.0, 1.0)
        line = seen - turn
        none = np.zeros_like(seen)
        turned = np.column_stack([*rotate(seen[:, 0], seen[:, 1], -seen[:, 2]), none[:, 0]])
        ways = (straight_twist(seen), none), (turn, turned), (line, turn)
        moves = np.stack([np.stack(way, axis=1) for way in ways], axis=1)
        times = self._time(moves)
        return moves / times[..., None], times


class DifferentialMotions(Unsteered):
    """Straights, arcs, and turning on the spot; a turn, a line in either gear, and a turn.

    Of a robot that hardly turns to one side, or not at all: it goes round by the other one.
    """

    def __init__(self, request: PathRequest, rates: tuple[float, float]) -> None:
        self._speeds, self._rates = (float(request.forward[0]), float(request.backward[0])), rates
        turns = [sign * rate for sign, rate in zip((1.0, -1.0), rates, strict=True) if rate > 0.0]
        drives = [gear * v for gear, v in zip((1.0, -1.0), self._speeds, strict=True) if v > 0.0]
        moves = [(speed, 0.0, turn) for speed in (*drives, 0.0) for turn in (0.0, *turns)]
        self.twists: Array = np.array([move for move in moves if any(move)])
        self.gears: Array = np.sign(self.twists[:, 0])
        self.turn = FULL / 16

    def connect(self, start: Array, ends: Array) -> tuple[Array, Array]:
        """Give both ways of three motions."""
        seen = seen_from(start, ends)
        x, y, turn = seen.T
        far, course = np.hypot(x, y), np.arctan2(y, x)
        ways, times = [], []
        for behind, gear, speed in zip((0.0, math.pi), (1.0, -1.0), self._speeds, strict=True):
            first = np.where(far > TINY, course + behind, 0.0)
            spins, lasts = zip(*(self._turn(angle) for angle in (first, turn - first)), strict=True)
            line = np.zeros((len(far), 3))
            line[:, 0] = gear * max(speed, TINY)
            ways.append(np.stack([spins[0], line, spins[1]], axis=1))
            drive = far / speed if speed > 0.0 else np.full_like(far, np.inf)
            times.append(np.stack([lasts[0], drive, lasts[1]], axis=1))
        return np.stack(ways, axis=1), np.stack(times, axis=1)

    def _turn(self, angle: Array) -> tuple[Array, Array]:
        """Twists (n, 3) and times (n,) of turns by angles (n,): to the side that is quicker."""
        # next to a whole turn is the rounding of none
        times = [
            (np.mod(sign * angle + TINY, FULL) - TINY).clip(0.0) / max(rate, TINY)
            for sign, rate in zip((1.0, -1.0), self._rates, strict=True)
        ]
        left = times[0] <= times[1]
        twists = np.zeros((len(angle), 3))
        twists[:, 2] = np.where(left, self._rates[0], -self._rates[1])
        return twists, np.where(left, *times)


def motions_of(
    problem: NavigationProblem, wheels: Wheels, request: PathRequest, tight: bool
) -> Motions:
    """Motions of wheels at the speeds of a request; turns to either side by a problem's bounds.

    `tight`: whether a car that steers slowly makes its tightest circles all the same.
    """
    if isinstance(wheels, Car):
        return CarMotions(wheels, request, tight)
    if isinstance(wheels, Omni):
        return OmniMotions(request, float(problem.u_max[1]))
    left, right = float(problem.u_max[-1]), -float(problem.u_min[-1])
    return DifferentialMotions(request, (TURN_SHARE * left, TURN_SHARE * right))
