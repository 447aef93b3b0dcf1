"""Paths of any wheels and outlines: a tree of poses grows from the goal until the start is reached.

From its goal back, a robot's own motions lead to ever more poses; of those in one cell of place and
heading the cheapest is kept, so that the tree becomes the field of the cost to go. Those that seem
nearest to the start, around what is in the way, grow first. From the start, ways that the wheels
know (curves of Reeds and Shepp for a car) lead to poses of the tree; the cheapest one that is clear
is the path, which so begins and ends exactly where it must. Where there is none soon, another tree
grows from the start until both meet. The cost is time, longer near obstacles, and a price for each
change of gear.

Each node of a tree knows how it is left: by which twist, held how long, and to which node that
leads. So a path from any of them to the goal is exact, whatever the cells are.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from kmpc_lite.control.path.distance_grid import DistanceGrid, Extent, MapFields
from kmpc_lite.control.path.distance_grid import Ways as Way
from kmpc_lite.control.path.motions import TINY, Motions, motions_of, moved, sampled
from kmpc_lite.control.path.planner import Path, PathRequest
from kmpc_lite.control.path.ways import Line, OutlineClearance, Piece, Ways
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.wheels import Car, Omni, Wheels
from kmpc_lite.geometry import nearest_turn
from kmpc_lite.types import Array

MOST = 30_000  # nodes after which a search gives up
MOST_HALVINGS = 4  # how often the cells of poses between obstacles are halved
HALF_WIDTH = 1 << 18  # most cells from the goal in any direction
BETTER = 0.995  # a pose takes another one's cell if it costs less than this share of it


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
        return self._key_of(poses, *np.zeros((2, len(poses)), dtype=int))

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

    def forget(self, node: int) -> None:
        """Forget a node, and all that it leads on to."""
        parents, gone = self.parents[: self.count], np.zeros(self.count + 1, dtype=bool)
        gone[node], count = True, 0  # the root's parent is the last one, which never goes
        while count < (count := int(np.count_nonzero(gone))):
            gone[:-1] |= gone[parents]
        self.costs[: self.count][gone[:-1]] = np.inf
        self._open[: self.count][gone[:-1]] = False

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


BATCH = 48  # poses from which the tree grows at once
PART_QUANTA = 10  # work of a batch, in quanta of 0.2 ms
WEIGHTS = (2.0, 6.0)
"""How many times the time to go, which knows of no change of gear, counts in the order in which the
first tree grows, and later ones: most of what lies about the straight way is left out."""
GOOD = 1.05  # a way from start to goal that costs less than so many times its time is the path
GEAR_PRICE = 4.0  # what a change of gear costs: the time in which the robot drives so many radii
LONGEST_STEP = 4.0  # in the open the tree grows by so many usual steps at once ...
ROOMY = 0.4
"""... and by less where there is less clearance than this [radii], in finer cells: by its share of
that, ..."""
ATTEMPTS = ((0.2, 1, 80), (0.03, 1, 400), (0.03, 1, 400), (0.03, 4, 400))
"""Clearance that is kept beyond the margin [radii], ... to which power, and for how many batches:
one after the other, until there is a path."""
HALVES = np.array((0.5, 1.0))
CELL = 0.35  # least side of the cells in which the way to the start is looked for [radii]
DOUBTED = 4.0
"""How many times its length a way through a cell counts of which only a part may be free: a tree
that is drawn to a gap in which there is none grows nowhere else."""
BORDER = 12.0
"""How far a search reaches around start, goal and obstacles, in turning or robot radii."""
BEND = 0.08  # largest turn between two poses of a path [rad]
KNOTS = 16  # poses of a path between which better ways are looked for
EXTRA = 4  # batches after the first path, and half of those before it, that look for a better one
NO_ROOM = "there is no room to turn: the goal's place can be reached, but not its heading"
NO_WAY = "no passage to the goal is wide enough"
GAVE_UP = "the search for a path gave up: the goal's place can be reached, perhaps not its heading"


class FieldPlanner:
    """Looks for paths by what the wheels let the robot do, part by part.

    `problem`: radius, margin, and how fast it turns to either side or an omni drives sideways.
    `wheels`: in the problem's units.
    """

    def __init__(self, problem: NavigationProblem, wheels: Wheels) -> None:
        self._wheels, self._radius = wheels, problem.body_radius
        self._problem, self._margin = problem, problem.margin
        self._found: Path | str | None = None
        self._maps = MapFields()

    def begin(self, request: PathRequest) -> None:
        """Begin a search."""
        self._request, self._found = request, None
        self._motions: Motions = motions_of(self._problem, self._wheels, request, False)
        self._clearance = OutlineClearance(request, self._margin)
        speed = float(request.forward[0])
        self._gear_price = max(GEAR_PRICE * self._radius / speed, request.gear_time)
        tightest = float(np.abs(self._motions.twists[:, 2]).max())
        # a step turns by an angle at the least, and leaves its cell
        self._step = max(self._motions.turn / tightest, self._radius / speed)
        self._turn_rate, self._speed, self._cell = tightest, speed, 0.9 * self._step * speed
        self._survey = self._look_around()
        self._quanta = next(self._survey)  # of the survey's part that comes next; none is left at 0
        self._best: tuple[Piece, int] | None = None
        self._is_exhausted = False
        self._line: Line | None = None
        self._begin_tree(0)

    def _begin_tree(self, attempt: int) -> None:
        """Begin a tree; later ones take finer steps where there is little clearance."""
        request = self._request
        self._attempt, (kept, _, most) = attempt, ATTEMPTS[attempt]
        # where there is no room for wide curves there is time for tight ones
        self._motions = motions_of(self._problem, self._wheels, request, attempt > 0)
        now = request.gear, request.curvature
        self._ways = Ways(self._motions, self._clearance, self._radius, self._gear_price, now)
        self._clearance.keep(kept * self._radius)
        # steps of the first tree are as long as finds most ways soon, later ones hardly longer than
        # the clearance
        shortest = 0.5 * self._step * self._speed if attempt > 1 else 0.0
        self._roomy = max(ROOMY * self._radius, shortest)
        self._tree, self._other = (
            PoseTree(root, self._cell, self._motions.turn, request.goal)
            for root in (request.goal, request.start)
        )
        self._other.gears[0] = int(request.gear)
        self._price, self._batches, self._last = math.inf, 0, most

    def path(self) -> Path | str | None:
        """What was found."""
        return self._found

    def advance(self, quanta: int) -> int:
        """Search on."""
        done = 0
        while done < quanta and self._found is None:
            if self._quanta:
                done += self._quanta
                self._quanta = next(self._survey, 0)
                continue
            done += PART_QUANTA * (3 if self._attempt else 2) // 2
            if self._line is not None:
                # better ways from one pose of the path; the first one's is the path at last
                self._ways.improve(self._line, self._knot)
                if not self._knot:
                    self._found = self._path_of(self._line.ways[0])
                self._knot -= 1
            elif not self._batches:
                self._look_straight()
            else:
                self._grow()
        return done

    def _look_around(self) -> Iterator[int]:
        """Find in parts how far it is from the start, for what is as wide as the outline's core."""
        request, radius = self._request, self._radius
        arms = float(np.hypot(request.outline[:, 0], request.outline[:, 1]).max())
        border, apart = BORDER * (radius + arms), math.dist(request.start[:2], request.goal[:2])
        least = radius if arms else radius + self._margin + ATTEMPTS[-1][0] * radius
        fields = self._maps.of(request.solids, CELL * radius)
        for around in (4.0 * border + apart, math.inf):
            grid = DistanceGrid(request, Extent(CELL * radius, around, border), fields)
            yield from grid.see(width=8, least=2)
            yield 2 * PART_QUANTA
            (sure, _), last = grid.free(least), grid.is_whole or around == math.inf
            costs, loose = np.where(sure, 1.0, DOUBTED), radius - 0.7 * grid.step
            # a cell is free if a point in it may be; if there is a way, none leads through walls
            for nearest in (max(loose, 0.5 * grid.step), loose)[: 1 + last]:
                free, start = sure | (grid.distance >= nearest), grid.node(request.start)
                ways = Way(free, costs, grid.step, start)
                if connects := bool(np.isfinite(ways.cost[grid.node(request.goal)])):
                    break
            if connects or last:
                break
        self._grid, self._from_start, self._connects = grid, ways.cost, connects

    def _time_to(self, end: Array, poses: Array) -> tuple[Array, Array]:
        """Least time (...) from poses (..., 3) to start or goal [s], and whether there is a way.

        By the distance, around what is in the way to the start; or by how far it must turn.
        """
        grid, speed = self._grid, max(self._request.forward[0], self._request.backward[0])
        place = (poses[..., :2] - grid.low) / grid.step
        inside = ((place >= -1.0) & (place <= grid.shape)).all(axis=-1)
        cells = np.rint(place).astype(np.intp)
        row, column = np.moveaxis(np.clip(cells, 0, np.array(grid.shape) - 1), -1, 0)
        from_start = self._from_start[row * grid.shape[1] + column]
        away = from_start - grid.step
        if end is not self._request.start:
            away = np.hypot(poses[..., 0] - end[0], poses[..., 1] - end[1])
        turn = poses[..., 2] - end[2]
        turns = np.abs(turn - nearest_turn(turn)) / self._turn_rate
        return np.maximum(away / speed, turns), inside & np.isfinite(from_start)

    def _look_straight(self) -> None:
        """Look for a way from start to goal; one that costs hardly more than its time is best."""
        self._batches = 1
        self._connect(0, np.zeros(1, dtype=np.intp))
        if self._best is not None and self._price <= GOOD * float(self._best[0].times.sum()):
            self._found = self._path_of(self._best[0])

    def _grow(self) -> None:
        """Let the tree grow by a batch, and look for ways from the start to it."""
        tree = self._tree
        nodes, least = tree.cheapest(BATCH)
        ended = not len(nodes) or tree.count >= MOST or self._batches >= self._last
        if ended or least >= WEIGHTS[self._attempt > 0] * self._price:
            last = self._attempt + 1 == len(ATTEMPTS)
            # from no pose of a tree of fine steps it goes on
            self._is_exhausted |= not len(nodes) and self._attempt > 0
            if self._best is None and self._connects and not last:
                self._begin_tree(self._attempt + 1)
            else:
                self._begin_improving()
            return
        self._batches += 1
        self._extend(tree, nodes, -1.0, self._request.start)
        first = self._best is None
        self._connect(0, nodes)
        if self._attempt:
            # between things it grows from the start, too, until both meet
            others, _ = self._other.cheapest(BATCH)
            self._extend(self._other, others, 1.0, self._request.goal)
            self._look_between(nodes, others)
        if first and self._best is not None:
            self._last = self._batches + EXTRA + self._batches // 2

    def _extend(self, tree: PoseTree, nodes: Array, way: float, end: Array) -> None:
        """Let motions lead from nodes (n,) of a tree, or to them where the way is back in time."""
        if not len(nodes):
            return
        poses, costs, gears = tree.poses[nodes], tree.costs[nodes], tree.gears[nodes]
        moves, gear = self._motions.twists, self._motions.gears
        steps = self._step * self._steps_at(self._clearance.room(poses))
        times = np.repeat(steps[:, None], len(moves), axis=1)
        led = moved(poses[:, None, None], moves[:, None], way * HALVES * times[..., None])
        kept = self._clearance.at(led.reshape(-1, 3)).reshape(led.shape[:3])
        costs = costs[:, None] + times * self._clearance.price(kept).mean(axis=2)
        costs = costs + self._gear_price * (gears[:, None] * gear < 0)
        to_go, within = self._time_to(end, led[:, :, 1])
        good = (kept.min(axis=2) >= 0.0) & within & (costs + to_go < self._price)
        row, column = np.nonzero(good)
        if len(row):
            steps = np.minimum(self._steps_at(kept[row, column, 1]), 1.0)
            tree.add(
                nodes[row],
                led[row, column, 1],
                moves[column],
                times[row, column],
                costs[good],
                np.where(gear[column] != 0, gear[column], gears[row]).astype(np.int8),
                costs[good] + WEIGHTS[self._attempt > 0] * to_go[good],
                np.ceil(-np.log2(steps)).astype(int),
            )

    def _steps_at(self, room: Array) -> Array:
        """Lengths (n,) of steps from poses of a clearance (n,), in usual ones."""
        room = np.maximum(room, 0.0)
        share = np.minimum(room / self._roomy, 1.0)
        finer = np.maximum(share ** ATTEMPTS[self._attempt][1], 2.0**-MOST_HALVINGS)
        # what is surely clear
        longer = np.clip(room / (self._step * self._speed), 1.0, LONGEST_STEP)
        out: Array = finer * longer
        return out

    def _look_between(self, nodes: Array, others: Array) -> None:
        """Look where nodes (n,) of the tree, and others (m,) of that from the start, come near."""
        tree, other = self._tree, self._other
        others = np.unique(np.concatenate([others, *other.beside(tree.poses[nodes])]))
        beside = tree.beside(other.poses[others])
        prices = [tree.costs[n].min(initial=math.inf) for n in beside] + other.costs[others]
        for best in np.argsort(prices)[:3].tolist() if len(others) else ():
            if prices[best] < self._price:
                self._connect(int(others[best]), beside[best][:BATCH])

    def _connect(self, begin: int, nodes: Array) -> None:
        """Take the cheapest clear way from a node of the other tree to nodes (n,) of this one."""
        tree, other, ways, request = self._tree, self._other, self._ways, self._request
        first = Piece(*(part[::-1] for part in other.way_of(begin)))
        before: tuple[float, float | None] = request.gear, request.curvature
        if begin:
            speed, turn_rate = other.twists[begin, [0, 2]].tolist()
            before = float(other.gears[begin]), turn_rate / speed if speed else None
        price, most = float(other.costs[begin]), self._price - float(other.costs[begin])
        ends = tree.poses[nodes], tree.costs[nodes], tree.gears[nodes]
        for more, way, row in ways.ranked(other.poses[begin], *ends, most, before):
            node, begun = int(nodes[row]), first.then(way)
            if ways.is_clear(request.start, begun.then(tree.way_of(node))):
                self._price, self._best = price + more, (begun, node)
                break
            if ways.is_clear(other.poses[begin], way):
                self._forget_unclear(tree, node, False)
                self._forget_unclear(other, begin, True)

    def _forget_unclear(self, tree: PoseTree, node: int, onwards: bool) -> None:
        """Forget what grew by a step of a node's line that is clear at a few places alone."""
        for k in tree.line_of(node)[::-1].tolist():
            step = Piece(tree.twists[k : k + 1], tree.times[k : k + 1])
            if not self._ways.is_clear(tree.poses[tree.parents[k] if onwards else k], step):
                tree.forget(k)
                return

    def _begin_improving(self) -> None:
        """Take the best path so far; the next parts look for better ways between its poses."""
        if self._best is None:
            self._found = self._reason()
            return
        (way, node), tree = self._best, self._tree
        ends = tree.line_of(node)
        chosen = np.unique(np.linspace(0, len(ends), min(len(ends) + 1, KNOTS)).round().astype(int))
        nodes = np.append(ends, 0)[chosen]
        parts = np.split(ends, chosen)[1:-1]
        ways = [way, *(Piece(tree.twists[part], tree.times[part]) for part in parts)]
        poses = np.concatenate([self._request.start[None], tree.poses[nodes]])
        costs = np.concatenate([[self._price], tree.costs[nodes]])
        gears = np.concatenate([[0], tree.gears[nodes]])
        self._line, self._knot = Line(poses, costs, gears, ways), len(ways) - 1

    def _reason(self) -> str:
        """Why there is no path."""
        if not self._connects:
            return NO_WAY
        if not self._is_exhausted:
            return GAVE_UP
        return NO_ROOM if isinstance(self._wheels, Car) else NO_WAY

    def _path_of(self, motions: Piece) -> Path:
        """Poses and times of motions from the start to the goal."""
        request = self._request
        if not (motions.times > TINY).any():
            return Path(np.stack([request.start, request.start]))
        used = motions.times > TINY
        twists, times = motions.twists[used], motions.times[used]
        lengths = np.hypot(twists[:, 0], twists[:, 1]) * times / (2.0 * self._radius)
        counts = np.ceil(np.maximum(lengths, np.abs(twists[:, 2]) * times / BEND) - TINY)
        counts = np.maximum(counts, 1).astype(np.intp)
        poses, when = sampled(request.start, twists, times, counts)
        paced = np.concatenate([[0.0], np.cumsum(self._motions.paced(twists, times))])
        when = np.interp(when, np.concatenate([[0.0], np.cumsum(times)]), paced)
        turns = round(float(poses[-1, 2] - request.goal[2]) / math.tau)  # rounding alone
        poses[-1] = request.goal + (0.0, 0.0, turns * math.tau)
        kept = self._clearance.on_way(poses)
        driven = request.driven
        switched = driven is None or _strays(poses[:, :2], driven.points, 2.0 * self._radius)
        return Path(
            poses, when, max(float(kept.min()), 0.0), switched, isinstance(self._wheels, Omni)
        )


def _strays(points: Array, line: Array, limit: float) -> bool:
    """Whether one of points (n, 2) is farther from a line (k, 2), maybe long, than a limit [m]."""
    steps, grid = np.linspace(0.0, len(line) - 1.0, 20 * len(line)), np.arange(len(line))
    line = np.stack([np.interp(steps, grid, line[:, i]) for i in (0, 1)], axis=1)
    for some in np.split(points, range(64, len(points), 64)):
        low, high = some.min(axis=0) - limit, some.max(axis=0) + limit
        near = line[((line >= low) & (line <= high)).all(axis=1)]
        away = np.hypot(*(some[:, None] - near).transpose(2, 0, 1))
        if (away.min(axis=1, initial=np.inf) > limit).any():
            return True
    return False
