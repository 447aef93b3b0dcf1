"""How fast a car's wheels are steered: a ramp of their curvature.

A servo turns at a rate of its own: the larger a change, the longer it takes. Taken for a lag it
would be too late for small changes, which it follows at once, and too early for large ones.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.learn.cross_validation import SelectionOptions
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.ramp_search import RampOptions, follow, is_sure, responses, which_best
from kmpc_lite.model.dictionary.curvature import held_curvatures
from kmpc_lite.model.ramps import FREE
from kmpc_lite.types import Array

FEWEST = 3
"""Commands that change faster than the wheels, from which on the log shows their rate."""
EXPLAINED = 0.5
"""Share of the turns, squared, that the steering must explain."""
FINE = 3
"""How many times as close as at first responses lie that need no rate."""


def find_steering_rate(dataset: Dataset, options: RampOptions | None = None) -> float:
    """Find how fast the curvature of a car changes [1/m per second]; infinite if none is sure.

    Turns are predicted from the ways that were driven: how the speed follows does not matter.
    """
    options = RampOptions() if options is None else options
    pieces, count = [], 0
    for episode in dataset.episodes:
        moved = episode.moved
        pieces.append((held_curvatures(episode.inputs), moved[:, 0], moved[:, -1]))
        count += len(episode)
        if count >= options.most_steps:
            break
    told = np.concatenate([curvatures for curvatures, _, _ in pieces])
    changes = np.concatenate([np.abs(np.diff(c)) for c, _, _ in pieces]) / dataset.dt
    sharpest = float(np.abs(told).max())
    if len(changes) < FEWEST or not sharpest > 0.0:
        return FREE
    least, most = sharpest / options.longest, float(np.sort(changes)[-FEWEST])
    if most <= least:
        return FREE
    rates = least * options.step ** np.arange(int(np.log(most / least) / np.log(options.step)) + 1)
    errors, turned = _errors(pieces, rates, dataset.dt, options)
    none, _ = _errors(pieces, np.array([FREE]), dataset.dt, options, FINE)
    left = min(e.sum(axis=2).min(initial=np.inf) for e in (none, errors))
    if errors.shape[2] < options.blocks // 2 or not left < (1.0 - EXPLAINED) * turned:
        return FREE
    if not is_sure(none, errors, options):
        return FREE
    around = rates[which_best(errors)] * options.refined ** np.arange(-3, 4)
    found = around[which_best(_errors(pieces, around, dataset.dt, options)[0])]
    return float(found) if found < most else FREE


def _errors(
    pieces: list[tuple[Array, Array, Array]],
    rates: Array,
    dt: float,
    options: RampOptions,
    parts: int = 1,
) -> tuple[Array, float]:
    """Squared errors (C, R, B) of rates, with each of R responses, in each block of the log.

    Beside them the squares of all turns.
    """
    longest = SelectionOptions().longest_history(dt)
    kinds = responses(dt, longest, parts)
    length = max(1, round(options.window / dt))
    seen, ways = [], []
    for told, driven, turned in pieces:
        if len(told) < longest + 2 * length:
            continue
        passed, _ = follow(told, rates, rates, dt)
        ends = np.arange(longest + length, len(told) + 1, max(1, length // 2))
        by_age = [
            _over(driven[longest:, None] * passed[longest - age : len(told) - age], ends - longest,
                  length)
            for age in range(longest + 1)
        ]  # fmt: skip
        ways.append(np.tensordot(kinds, np.stack(by_age), axes=1))
        seen.append(_over(turned[longest:, None], ends - longest, length)[:, 0])
    if not seen:
        return np.zeros((len(rates), len(kinds), 0)), 0.0
    turns, way = np.concatenate(seen), np.concatenate(ways, axis=1)
    gain = (way * turns[:, None]).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-12)
    left = (turns[:, None] - gain[:, None] * way) ** 2
    blocks = min(options.blocks, len(turns) // 8)
    parted = np.array_split(left, blocks, axis=1) if blocks else []
    found = np.zeros((len(rates), len(kinds), blocks))
    for b, block in enumerate(parted):
        found[:, :, b] = block.sum(axis=1).T
    return found, float(turns @ turns)


def _over(rows: Array, ends: Array, length: int) -> Array:
    """Sums (W, C) of so many rows (T, C) before each of the ends (W,)."""
    sums = np.cumsum(np.vstack([np.zeros(rows.shape[1]), rows]), axis=0)
    out: Array = sums[ends] - sums[ends - length]
    return out
