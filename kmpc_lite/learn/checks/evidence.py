"""What a log shows of how its motion follows from its heading and its commands.

A wheeled robot moves along its heading and turns as it is commanded: over any stretch of time the
displacement is proportional to the sum of ``v exp(i theta)``, and the turn to the sum of omega.
The factors tell units, the direction tells frames, and what is left over tells whether heading,
commands and motion belong together at all. Nothing here depends on how large or fast a robot is.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from kmpc_lite.learn.checks.motion import Motion
from kmpc_lite.types import Array

LENGTHS = (1, 2, 4, 8, 16, 32, 64, 128)
"""Rows of a window: short ones show lags, long ones what noise hides."""
LAGS = (0, 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
"""Rows by which the motion may come later, or earlier, than its command."""
FEWEST_WINDOWS = 12.0
"""Windows that do not overlap and are needed of one length."""
CHANCE = 1e-5
"""Probability that chance explains as much as counts as explained."""
LEAST_SHARE = 0.1
"""Share of a motion that has to be explained."""
LITTLE = 0.4
"""Share below which a motion counts as not explained, where chance could explain as much."""
LEAST_CHANGE = 0.05
"""Standard deviation of a command that changes, as a share of its largest value."""
DEGREES = np.pi / 180.0
SIGNS = (1, -1)


class Explained(NamedTuple):
    """How well commands explain a motion, at the best lag and length of windows."""

    share: float
    """Of the motion's energy: 1 is all of it."""
    chance: float
    """Share that chance could explain."""
    factor: complex
    """Motion for each unit that was asked; of displacements with its direction."""
    lag: int
    """Rows."""
    length: int
    """Rows of a window."""

    @property
    def beyond_chance(self) -> float:
        """Share of what chance leaves unexplained."""
        return (self.share - self.chance) / max(1.0 - self.chance, 1e-12)

    @property
    def sure(self) -> bool:
        """Whether it explains more than chance could."""
        return self.share > max(LEAST_SHARE, self.chance)

    @property
    def absent(self) -> bool:
        """Whether there is enough of a log to say that it does not explain the motion."""
        return self.chance < 1.0 and not self.sure and self.share < LITTLE


NOTHING = Explained(0.0, 1.0, 0.0, 0, 1)


@dataclass(frozen=True)
class Evidence:
    """How well commands explain a log's motion, under each reading of theta."""

    motion: Motion
    moves: dict[tuple[int, bool], Explained]
    """Displacements, by the sign of theta and whether it is taken for degrees."""
    turns: dict[bool, Explained]
    """Turns, by whether theta is taken for degrees."""

    @property
    def best(self) -> tuple[int, bool]:
        """Sign of theta, and whether it is in degrees, that explain the displacements best."""
        return max(self.moves, key=lambda key: self.moves[key].share)

    @property
    def delay(self) -> float | None:
        """How long after its command the motion comes, in the log's unit of time, or None.

        A command that hardly changes explains the motion at any lag, so it tells none.
        """
        found = [e for e in self.turns.values() if e.sure and _changes(self.motion, 1)]
        moves = self.moves[self.best]
        if moves.sure and _changes(self.motion, 0):
            found.append(moves)
        if not found:
            return None
        best = max(found, key=lambda e: e.share)
        return _refined_lag(self.motion, best, best is not moves, self) * self.motion.period


def examine(motion: Motion) -> Evidence:
    """Regress displacements and turns on the commands, under each reading of the heading."""
    moves = {
        (sign, degrees): _explain_moves(motion, sign, degrees)
        for sign, degrees in product(SIGNS, (False, True))
    }
    turns = {degrees: _explain_turns(motion, degrees) for degrees in (False, True)}
    return Evidence(motion, moves, turns)


def facing(motion: Motion, sign: int, degrees: bool) -> Array:
    """exp(i theta) in the middle of each step, complex (n - 1,), under one reading of theta."""
    theta = sign * motion.theta * (DEGREES if degrees else 1.0)
    turned = np.exp(1j * theta)
    middle = turned[1:] + turned[:-1]
    size = np.abs(middle)
    along: Array = np.where(size > 1e-9, middle / np.maximum(size, 1e-9), turned[:-1])
    return along


def headings(motion: Motion, degrees: bool) -> Array:
    """Theta without jumps (n,), under one reading."""
    steps = np.diff(motion.theta) * (DEGREES if degrees else 1.0)
    wrapped = np.remainder(steps + np.pi, 2.0 * np.pi) - np.pi
    return np.concatenate([[0.0], np.cumsum(wrapped)])


def _changes(motion: Motion, channel: int) -> bool:
    """Whether a command changes by enough to tell when it was given."""
    given = np.diff(motion.asked[:, channel])[motion.whole] / np.diff(motion.time)[motion.whole]
    return bool(given.std() > LEAST_CHANGE * np.abs(given).max(initial=0.0))


def _explain_moves(motion: Motion, sign: int, degrees: bool) -> Explained:
    """Displacements by v along the heading."""
    along = facing(motion, sign, degrees)
    return _best(motion, motion.position, np.diff(motion.asked[:, 0]), along)


def _explain_turns(motion: Motion, degrees: bool) -> Explained:
    """Turns by omega."""
    return _best(motion, headings(motion, degrees), np.diff(motion.asked[:, 1]), 1.0)


def _best(motion: Motion, moved: Array, asked: Array, along: Array | float) -> Explained:
    """Explain `moved` (n,) by steps `asked` (n - 1,) that act `along`: the best lag and length."""
    lags = sorted({sign * lag for sign in SIGNS for lag in LAGS if lag < len(asked) // 4})
    found = [
        result for lag in lags for result in _explain(motion, moved, asked, along, lag, LENGTHS)
    ]
    return max(found, key=lambda e: e.beyond_chance, default=NOTHING)


def _explain(
    motion: Motion,
    moved: Array,
    asked: Array,
    along: Array | float,
    lag: int,
    lengths: tuple[int, ...],
) -> list[Explained]:
    """Explain a motion at one lag, for windows of several lengths."""
    late, whole = shifted(asked, lag), motion.whole & shifted(motion.whole, lag)
    acting = np.where(whole, late * along, 0.0)
    total = np.concatenate([[0.0], np.cumsum(acting)])
    broken = np.concatenate([[0], np.cumsum(~whole)])
    found = []
    for length in lengths:
        if len(total) <= length:
            continue
        good = broken[length:] == broken[:-length]
        count = float(good.sum()) / max(length, motion.change)
        if count < FEWEST_WINDOWS:
            continue
        x, y = (total[length:] - total[:-length])[good], (moved[length:] - moved[:-length])[good]
        xx, yy, xy = np.vdot(x, x).real, np.vdot(y, y).real, np.vdot(x, y)
        if xx <= 0.0 or yy <= 0.0:
            continue
        share = abs(xy) ** 2 / (xx * yy)
        fair = 1.0 - (1.0 - share) * count / (count - 1.0)
        chance = 1.0 - CHANCE ** (1.0 / (count - 1.0))
        found.append(Explained(float(fair), chance, complex(xy / xx), lag, length))
    return found


def shifted(values: Array, lag: int) -> Array:
    """Values (n,) that come `lag` rows later; nothing comes in."""
    moved = np.roll(values, lag)
    if lag > 0:
        moved[:lag] = 0
    elif lag < 0:
        moved[lag:] = 0
    return moved


def _refined_lag(motion: Motion, best: Explained, turn: bool, evidence: Evidence) -> float:
    """Lag of the best explanation to a share of a row: the top of a parabola."""
    along: Array | float
    if turn:
        degrees = evidence.turns[True] == best
        moved, asked, along = headings(motion, degrees), np.diff(motion.asked[:, 1]), 1.0
    else:
        moved, asked = motion.position, np.diff(motion.asked[:, 0])
        along = facing(motion, *evidence.best)
    length = min(best.length, 4)
    shares = {}
    for lag in range(best.lag - 4, best.lag + 5):
        found = _explain(motion, moved, asked, along, lag, (length,))
        shares[lag] = found[0].share if found else -1.0
    top = max(shares, key=lambda lag: shares[lag])
    before, here, after = (shares.get(top + k, -1.0) for k in (-1, 0, 1))
    curve = before - 2.0 * here + after
    if min(before, after) < 0.0 or curve >= 0.0:
        return float(top)
    return top + 0.5 * (before - after) / curve


def heading_offset(evidence: Evidence, key: tuple[int, bool]) -> tuple[float, float]:
    """Direction of the motion off the heading, and how sure it is [rad], for one reading of theta.

    Turning moves a sensor that does not stand on the turning centre; that is regressed too.
    """
    motion, best = evidence.motion, evidence.moves[key]
    along = facing(motion, *key)
    whole = motion.whole & shifted(motion.whole, best.lag)
    steps = [np.where(whole, shifted(np.diff(a), best.lag) * along, 0.0) for a in motion.asked.T]
    sums = [np.concatenate([[0.0], np.cumsum(s)]) for s in steps]
    broken = np.concatenate([[0], np.cumsum(~whole)])
    n = best.length
    good = broken[n:] == broken[:-n]
    x = np.column_stack([(s[n:] - s[:-n])[good] for s in sums])
    y = (motion.position[n:] - motion.position[:-n])[good]
    size = np.sqrt(np.maximum((np.abs(x) ** 2).sum(axis=0), 1e-300))
    scaled = x / size
    weights, _, rank, _ = np.linalg.lstsq(scaled, y, rcond=1e-3)
    if rank < 2:
        return float(np.angle(best.factor)), 0.0 if size[1] <= 1e-150 else np.pi
    left = y - scaled @ weights
    count = max(len(y) / max(n, motion.change), 2.0)
    gram = np.linalg.inv((scaled.conj().T @ scaled).real)
    spread = np.sqrt(np.vdot(left, left).real / len(y) * gram[0, 0] * len(y) / count)
    return float(np.angle(weights[0])), float(spread / max(abs(weights[0]), 1e-300))
