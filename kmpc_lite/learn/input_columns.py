"""What a log's input columns are: commands, or speeds that were measured.

A command is held, changes at once, or changes steadily, as a ramp does. A measured speed follows
the motors and is noisy: from one value to the next it changes a little, and never by the same
amount twice. A recorder may repeat it until the next measurement comes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.windows import largest_speeds
from kmpc_lite.types import Array

SAME = 2e-4
"""Changes below this share of the largest are none: a log has so many digits."""
HOLD = 0.28
"""A value that stays for so long [s] is held: no sensor is that slow ..."""
HOLD_ROWS = 3
"""... and for so many rows."""
HELD = 0.2
"""Share of rows in such holds from which on the inputs are commands."""
STEADY = 0.2
"""Share of changes that equal the one before from which on the inputs are commands."""
JUMPS = 0.8
"""Correlation of one value with the next below which the inputs are commands."""


@dataclass(frozen=True)
class Shares:
    """What the values of the inputs show."""

    held: float
    """Share of the moving rows whose value stays for long."""
    steady: float
    """Share of the changes that equal the one before."""
    alike: float
    """Correlation of a value with the next one that differs."""


def tell_inputs(dataset: Dataset, delay: float) -> str:
    """What the input columns are: commands, or speeds that were measured.

    Parameters
    ----------
    dataset : Dataset
        The log.
    delay : float
        How far the poses lag behind the inputs [s].
    """
    shares = find_shares(dataset)
    lead = f"poses follow {delay:.2f} s later"
    if shares is None:
        return "unknown: they hardly change"
    if shares.held >= HELD:
        return f"commands ({100 * shares.held:.0f} % of the rows are held; {lead})"
    if shares.steady >= STEADY:
        return f"commands ({100 * shares.steady:.0f} % of the changes go on as ramps; {lead})"
    if shares.alike < JUMPS:
        return f"commands (they change at once, from one value to any other; {lead})"
    return (
        f"measured speeds, of encoders for example (noisy, and never at a jump; {lead}): "
        "the motors' lag is not in them"
    )


def find_shares(dataset: Dataset) -> Shares | None:
    """Look at the values of the inputs; None if too few of them differ."""
    largest = np.array(largest_speeds(dataset))
    least = max(HOLD_ROWS, round(HOLD / dataset.dt))
    held = rows = steady = changes = 0
    pairs = []
    for episode in dataset.episodes:
        values = episode.inputs / largest
        new = np.abs(np.diff(values, axis=0)).max(axis=1) > SAME
        firsts = np.concatenate([[0], np.flatnonzero(new) + 1])
        lengths = np.diff(np.concatenate([firsts, [len(values)]]))
        moving = np.abs(values[firsts]).max(axis=1) > SAME
        rows += int(lengths[moving].sum())
        held += int(lengths[moving & (lengths >= least)].sum())
        change = np.diff(values[firsts], axis=0)
        again = np.abs(np.diff(change, axis=0)).max(axis=1) <= SAME
        steady, changes = steady + int(again.sum()), changes + len(again)
        pairs.append(np.hstack([values[firsts[:-1]], values[firsts[1:]]]))
    before_after = np.concatenate(pairs)
    if rows == 0 or changes < 10:
        return None
    return Shares(held / rows, steady / changes, _likeness(before_after))


def _likeness(pairs: Array) -> float:
    """Smaller of the two columns' correlations of a value with the next, (n, 4) -> number."""
    found = []
    for column in range(2):
        one, other = pairs[:, column], pairs[:, column + 2]
        if min(one.std(), other.std()) > 1e-6:
            found.append(float(np.corrcoef(one, other)[0, 1]))
    return min(found, default=1.0)
