"""A tree of poses that grows from a goal: one pose for each cell of place, heading and gear.

Each node knows how it is left: by which twist, held how long, and to which node that leads. So a
path from any of them to the goal is exact, whatever the cells are. Sizes: `MOST` nodes.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.path.ways import Piece
from kmpc_lite.types import Array

MOST = 30_000
"""Nodes after which a search gives up."""
MOST_HALVINGS = 4
"""How often the cells of poses between obstacles are halved."""
HALF_WIDTH = 1 << 18
"""Most cells from the goal in any direction."""
BETTER = 0.995
"""A pose takes another one's cell if it costs less than this share of it."""


class PoseTree:
    """Nodes as arrays, the cheapest pose of each cell, and those from which it can still grow.

    `root`: pose (3,). `cell`, `turn`: side of a cell [m], and how far it goes round [rad].
    `origin`: (3,) middle of a cell.
    """

    def __init__(self, root: Array, cell: float, turn: float, origin: Array) -> None:
        self._size, self._turns = np.array((cell, cell, turn)), round(2.0 * np.pi / turn)
        self._origin = origin.copy()
        self.count = 1
        self.poses, self.twists = np.zeros((2, MOST, 3))
        self.costs, self.times, self._order = np.zeros((3, MOST))
        self.parents = np.full(MOST, -1)
        self.gears = np.zeros(MOST, dtype=np.int8)
        self._open = np.zeros(MOST, dtype=bool)
        self.poses[0], self._open[0] = root, True
        self._keys = self._key_of(root[None], self.gears[:1], np.zeros(1, dtype=int))
        self._nodes = np.zeros(1, dtype=np.intp)
        self._wholes, self._inside = self._whole_of(root[None]), np.zeros(1, dtype=np.intp)

    @property
    def is_full(self) -> bool:
        """Whether it cannot grow any more."""
        return self.count >= MOST

    def _key_of(self, poses: Array, gears: Array, halvings: Array) -> Array:
        """Numbers (n,) of the cells in which poses (n, 3) lie, which were halved so often (n,)."""
        parts = 1 << halvings
        scaled = (poses - self._origin) / self._size * parts[:, None]
        column, row, turn = np.rint(scaled).astype(np.int64).T
        places = (column + HALF_WIDTH) * (2 * HALF_WIDTH) + row + HALF_WIDTH
        turns = places * (self._turns << MOST_HALVINGS) + turn % (parts * self._turns)
        out: Array = (turns * 3 + gears + 1) * (MOST_HALVINGS + 1) + halvings
        return out

    def _whole_of(self, poses: Array) -> Array:
        """Numbers (n,) of the cells of poses (n, 3), of any gear, and before they are halved."""
        return self._key_of(
            poses, np.zeros(len(poses), dtype=np.int8), np.zeros(len(poses), dtype=int)
        )

    def beside(self, poses: Array) -> list[Array]:
        """Nodes, newest first, in the cells of poses (n, 3)."""
        keys = self._whole_of(poses)
        first, last = (np.searchsorted(self._wholes, keys, side) for side in ("left", "right"))
        return [self._inside[a:b] for a, b in zip(first, last, strict=True)]

    def cheapest(self, most: int) -> tuple[Array, float]:
        """Take the open nodes (n,) of the least estimates, and what the least of them is."""
        waiting = np.flatnonzero(self._open[: self.count])
        if not len(waiting):
            return waiting, np.inf
        order = self._order[waiting]
        if len(waiting) > most:
            waiting = waiting[np.argpartition(order, most)[:most]]
        self._open[waiting] = False
        return waiting, float(order.min())

    def add(
        self,
        parents: Array,
        poses: Array,
        twists: Array,
        times: Array,
        costs: Array,
        gears: Array,
        estimates: Array,
        halvings: Array,
    ) -> None:
        """Add poses (n, 3) that are the cheapest of their cells; `twists` lead to their parents.

        `costs` are those to the goal, `estimates` what they are ranked by, (n,) each; their cells
        are `halvings` (n,) times halved.
        """
        keys = self._key_of(poses, gears, halvings)
        ranked = np.lexsort((costs, keys))
        first = np.ones(len(keys), dtype=bool)
        first[1:] = keys[ranked[1:]] != keys[ranked[:-1]]
        chosen = ranked[first]
        keys = keys[chosen]
        places = np.searchsorted(self._keys, keys)
        inside = np.minimum(places, len(self._keys) - 1)
        known = self._keys[inside] == keys
        before = self._nodes[inside]
        better = ~known | (costs[chosen] < BETTER * self.costs[before])
        room = MOST - self.count
        kept = np.flatnonzero(better)[:room]
        chosen, known = chosen[kept], known[kept]
        nodes = np.arange(self.count, self.count + len(kept))
        self._open[before[kept][known]] = False
        self._nodes[inside[kept][known]] = nodes[known]
        self._keys = np.insert(self._keys, places[kept][~known], keys[kept][~known])
        self._nodes = np.insert(self._nodes, places[kept][~known], nodes[~known])
        self.poses[nodes], self.twists[nodes] = poses[chosen], twists[chosen]
        self.times[nodes], self.costs[nodes] = times[chosen], costs[chosen]
        self.parents[nodes], self.gears[nodes] = parents[chosen], gears[chosen]
        self._order[nodes], self._open[nodes] = estimates[chosen], True
        wholes = self._whole_of(poses[chosen])
        places = np.searchsorted(self._wholes, wholes)
        self._wholes = np.insert(self._wholes, places, wholes)
        self._inside = np.insert(self._inside, places, nodes)
        self.count += len(kept)

    def line_of(self, node: int) -> Array:
        """Nodes (k,) from one to the goal, which is left out."""
        out = []
        while self.parents[node] >= 0:
            out.append(node)
            node = int(self.parents[node])
        return np.array(out, dtype=np.intp)

    def way_of(self, node: int) -> Piece:
        """What is driven from a node to the goal."""
        line = self.line_of(node)
        return Piece(self.twists[line], self.times[line])
