"""The search for ramps, of speeds and of steering: which let through what the log shows.

A ramp is looked for beside the response (dead time and time constant) and the gain that suit it
best, and has to explain more than none does, on parts of the log that it was not chosen by.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kmpc_lite.learn.cross_validation import (
    SelectionOptions,
    assign_folds,
    critical_score,
    gain_score,
)
from kmpc_lite.learn.responses import Response, first_candidates, neighbours
from kmpc_lite.model.ramps import FREE
from kmpc_lite.types import Array

PARTS = 5
"""Parts of a period in which a ramp is reckoned."""
EXPLAINED = 0.5
"""Share of the motion, squared, that the commands must explain, by a ramp or without: of what is
noise of the poses, any ramp explains a part."""
FINE = 3
"""How many times as close as at first responses lie that need no ramp: none is to be taken for one
because a lag lies between two of them."""
MOST = 4
"""Pairs of ramps that are looked at at once: a matter of memory alone."""


WINDOW = 0.5
"""Length of the windows whose way is predicted [s]: longer than noise of poses matters."""
LONGEST = 6.0
"""Slowest ramp that is tried: time to the fastest command of the log [s]; slower ones are, too,
where a log drives in one direction for longer than its robot comes to speed by them."""
STEP = 1.3
"""Ratio of neighbouring ramps that are tried first."""
REFINED = 1.08
"""The same for those that are tried around the best one."""
SIGNIFICANCE = 0.05
"""Probability at which a ramp may be found that is none: driven more gently, nothing is lost; a
ramp that is missed is a stop that comes too late."""
WORTH = 0.05
"""Share of the squared error that a ramp must explain at the least."""
BLOCKS = 16
"""Parts of the log that must agree."""
MOST_STEPS = 20_000
"""Steps of the log that are looked at."""


def follow(told: Array, faster: Array, slower: Array, dt: float, at_ends: bool = False) -> Array:
    """Speeds that follow commanded ones (T,) by ramps (C,): means of periods (T, C), or at ends."""
    speed = np.full(len(faster), told[0])
    up, down = faster * dt / PARTS, slower * dt / PARTS
    found = np.empty((len(told), len(faster)))
    for k, aim in enumerate(told.tolist()):
        total = 0.5 * speed
        for _ in range(PARTS):
            grows = np.abs(aim) >= np.abs(speed)
            limit = np.where(grows & (aim * speed >= 0.0), up, down)
            speed = speed + np.minimum(np.maximum(aim - speed, -limit), limit)
            total = total + speed
        found[k] = speed if at_ends else (total - 0.5 * speed) / PARTS
    return found


class Stretch(NamedTuple):
    """What was commanded without a gap, and what came of it in each period."""

    told: Array
    """Commands, (T,)."""
    moved: Array
    """How far the robot went, or turned, (T,)."""
    carried: Array
    """What moves it by as much for each 1 of the command, (T,): the period, or a car's way."""


def find_ramp(
    stretches: Sequence[Stretch],
    faster: Array,
    slower: Array,
    dt: float,
    alike: bool = False,
) -> tuple[float, float]:
    """Find the pair of ramps (C,) that explains the motion; infinite if none is sure.

    Where the pairs are `alike`, those near the best one are tried with one ramp both ways, too.
    """
    none, limited = (np.array([FREE]),) * 2, (faster, slower)
    free, _ = _errors(stretches, *none, dt, FINE)
    errors, motion = _errors(stretches, *limited, dt)
    # by the best ramp: the commands of a robot that follows slowly explain little by themselves
    left = min(e.sum(axis=2).min(initial=np.inf) for e in (free, errors))
    if errors.shape[2] < BLOCKS // 2 or not left < (1.0 - EXPLAINED) * motion:
        return FREE, FREE
    if not is_sure(free, errors):
        return FREE, FREE
    best, around = _best(errors), REFINED ** np.arange(-3, 4)
    near = [v[best] * around if np.isfinite(v[best]) else v[[best]] for v in limited]
    faster, slower = near if alike else (a.ravel() for a in np.meshgrid(*near))
    best = _best(_errors(stretches, faster, slower, dt)[0])
    return float(faster[best]), float(slower[best])


def _errors(
    stretches: Sequence[Stretch],
    faster: Array,
    slower: Array,
    dt: float,
    parts: int = 1,
) -> tuple[Array, float]:
    """Squared errors (C, R, B) of ramps, with each of R responses, in each block of the log.

    Beside them what they are a part of: the squares of all that moved. Responses lie `parts` times
    as close as those that are tried first when a model is learned.
    """
    longest = SelectionOptions().longest_history(dt)
    kinds = responses(dt, longest, parts)
    length = max(1, round(WINDOW / dt))
    used = [s for s in stretches if len(s.told) >= longest + 2 * length]
    passed = [follow(s.told, faster, slower, dt) for s in used]
    seen = np.concatenate([np.empty(0), *(_windows(s.moved[longest:], length) for s in used)])
    blocks = min(BLOCKS, len(seen) // 8)
    found = np.zeros((len(faster), len(kinds), blocks))
    for some in (slice(k, k + MOST) for k in range(0, len(faster) if blocks else 0, MOST)):
        by_age = [
            [
                _windows(s.carried[longest:, None] * p[longest - age : len(p) - age, some], length)
                for age in range(longest + 1)
            ]
            for s, p in zip(used, passed, strict=True)
        ]
        way = np.tensordot(kinds, np.concatenate(by_age, axis=1), axes=1)
        gain = (way * seen[:, None]).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-12)
        left = (seen[:, None] - gain[:, None] * way) ** 2
        for b, block in enumerate(np.array_split(left, blocks, axis=1)):
            found[some, :, b] = block.sum(axis=1).T
    return found, float(seen @ seen)


def _windows(rows: Array, length: int) -> Array:
    """Sums (W, ...) of rows (T, ...) over whole windows, one every half of one."""
    sums = np.cumsum(np.concatenate([np.zeros_like(rows[:1]), rows]), axis=0)
    ends = np.arange(length, len(rows) + 1, max(1, length // 2))
    out: Array = sums[ends] - sums[ends - length]
    return out


def _best(errors: Array) -> int:
    """Which ramps (C, R, B) explain most, each with the response that suits it best."""
    return int(errors.sum(axis=2).min(axis=1).argmin())


def is_sure(free: Array, limited: Array) -> bool:
    """Whether ramps (C, R, B) explain more than none (1, R, B), beyond chance, and enough.

    What is compared on a part of the log was chosen on the others.
    """
    blocks = free.shape[2]
    folds, honest = assign_folds(blocks), np.empty((2, blocks))
    for kind, errors in enumerate((free, limited)):
        flat = errors.reshape(-1, blocks)
        for fold in range(int(folds.max()) + 1):
            out = folds == fold
            honest[kind, out] = flat[int(flat[:, ~out].sum(axis=1).argmin())][out]
    reference, errors = honest
    if errors.sum() > (1.0 - WORTH) * reference.sum():
        return False
    return gain_score(reference, errors) > critical_score(blocks, SIGNIFICANCE)


def responses(dt: float, longest: int, parts: int) -> Array:
    """Weights (R, longest + 1) of the commands' ages for each response that is tried."""
    tried = {Response(*r) for r in first_candidates(dt, longest)}
    for _ in range(parts - 1):
        tried |= {n for r in tried for n in neighbours(r, dt / parts, dt, longest)}
    kinds = np.zeros((len(tried), longest + 1))
    for response, row in zip(sorted(tried), kinds, strict=True):
        kernel = response.weights(dt, longest)
        row[: len(kernel)] = kernel
    return kinds
