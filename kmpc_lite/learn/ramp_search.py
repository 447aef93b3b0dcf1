"""What a search for ramps needs, of speeds and of steering: what they let through, and how sure.

A ramp is looked for beside the response (dead time and time constant) and the gain that suit it
best, and has to explain more than none does, on parts of the log that it was not chosen by.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.learn.cross_validation import assign_folds, critical_score, gain_score
from kmpc_lite.learn.responses import Response, first_candidates, neighbours
from kmpc_lite.types import Array

PARTS = 5
"""Parts of a period in which a ramp is reckoned."""


@dataclass(frozen=True)
class RampOptions:
    """How ramps are looked for."""

    window: float = 0.5
    """Length of the windows whose way is predicted [s]: longer than noise of poses matters."""
    longest: float = 6.0
    """Slowest ramp that is tried: time to the fastest command of the log [s]."""
    step: float = 1.3
    """Ratio of neighbouring ramps that are tried first."""
    refined: float = 1.08
    """The same for those that are tried around the best one."""
    significance: float = 0.05
    """Probability at which a ramp may be found that is none: driven more gently, nothing is lost; a
    ramp that is missed is a stop that comes too late."""
    worth: float = 0.05
    """Share of the squared error that a ramp must explain at the least."""
    blocks: int = 16
    """Parts of the log that must agree."""
    most_steps: int = 20_000
    """Steps of the log that are looked at."""


def follow(told: Array, faster: Array, slower: Array, dt: float) -> tuple[Array, Array]:
    """Speeds that follow commanded ones (T,) by ramps (C,): means and ends (T, C) of periods."""
    speed = np.full(len(faster), told[0])
    up, down = faster * dt / PARTS, slower * dt / PARTS
    means, ends = np.empty((2, len(told), len(faster)))
    for k, aim in enumerate(told.tolist()):
        total = 0.5 * speed
        for _ in range(PARTS):
            grows = np.abs(aim) >= np.abs(speed)
            limit = np.where(grows & (aim * speed >= 0.0), up, down)
            speed = speed + np.minimum(np.maximum(aim - speed, -limit), limit)
            total = total + speed
        means[k], ends[k] = (total - 0.5 * speed) / PARTS, speed
    return means, ends


def which_best(errors: Array) -> int:
    """Which ramps (C, R, B) explain most, each with the response that suits it best."""
    return int(errors.sum(axis=2).min(axis=1).argmin())


def is_sure(free: Array, limited: Array, options: RampOptions) -> bool:
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
    if errors.sum() > (1.0 - options.worth) * reference.sum():
        return False
    return gain_score(reference, errors) > critical_score(blocks, options.significance)


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
