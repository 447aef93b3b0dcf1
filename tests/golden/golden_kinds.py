"""Which drives are recorded, and how many of each kind."""

from __future__ import annotations

from collections.abc import Callable

import golden_mishaps as mishaps
import golden_robots as usual
import golden_tight as tight
import numpy as np
from golden_scripts import Random, Script

KINDS: dict[Callable[[Random, int], Script], int] = {
    usual.plain: 36,
    usual.lagging: 18,
    usual.noisy: 12,
    usual.turning: 8,
    usual.rates: 10,
    usual.paper: 10,
    usual.floors: 14,
    usual.converged: 8,
    usual.asymmetric: 8,
    mishaps.told: 8,
    mishaps.new_goals: 7,
    mishaps.appearing: 9,
    mishaps.broken_numbers: 10,
    mishaps.broken_solver: 14,
    mishaps.spoilt: 1,
    mishaps.budget: 6,
    mishaps.parking: 12,
    mishaps.carried: 6,
    mishaps.unreachable: 6,
    mishaps.chased: 10,
    usual.other_numbers: 11,
    mishaps.swapped: 2,
    mishaps.held: 6,
    tight.braked_often: 16,
    tight.squeezed: 15,
    tight.surrounded: 8,
    tight.fast: 5,
    tight.displaced: 8,
    tight.strange_floors: 6,
}
"""How many of each there are among 290."""


def scripts(count: int, seed: int) -> list[Script]:
    """Draw about as many drives, of all kinds in their shares; their order is mixed."""
    whole = sum(KINDS.values())
    random = np.random.default_rng(seed)
    drawn = [
        kind(random, i)
        for kind, share in KINDS.items()
        for i in range(max(1, round(share * count / whole)))
    ]
    return [drawn[i] for i in random.permutation(len(drawn))]
