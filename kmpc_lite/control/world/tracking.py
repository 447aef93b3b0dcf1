"""What is round: circles as given, what was seen of them, those out of reach, and pedestrians.

As long as every circle is where its velocity says, to rounding, nothing is done. Else all are
followed (`tracks`) until they do as given again, and those that move otherwise get the velocity
that they were seen to have, and room for its uncertainty. Clusters of scans are followed beside
them, by the same filter.

Where only what lies within `NavigationProblem.sensor_range` is given, a circle is missing for one
of two reasons. Within reach it has gone, and is forgotten at once. Out of reach, if it stands, it
counts as given again, or the robot would turn back from it, forget it, and come again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from kmpc_lite.control.kernels.records import (
    COLUMNS,
    PLACE,
    RADIUS,
    SPREAD_RATE,
    VELOCITY,
    distances,
    things_of,
)
from kmpc_lite.control.options import ControllerOptions, fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.local_map import LocalMap
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.control.world.tracks import (
    GIVEN,
    SCANNED,
    Follower,
    TrackedCircles,
    clusters,
    stand,
    walking_tracks,
    was_free,
)
from kmpc_lite.types import Array

ROUNDING = 1e-6
"""How far from its place a circle may be that moves as given: single precision [radii]."""
SAME_PLACE = 0.01  # a circle that is given so near to where it was is the same one [m]
NONE_MOVING = np.empty((0, COLUMNS))


@dataclass(frozen=True, slots=True)
class Around:
    """What is round, in a step."""

    things: Array  # (M, 7) those that were given, then those that scans show to walk
    walking: int  # how many of them scans show to walk
    perhaps: Array
    """(P, 7) what seems to walk in scans, but may be a piece of something that stands."""


class Tracking:
    """Follows what is round; it remembers nothing itself.

    `problem`: its `sensor_range`, radius, speeds and period, in the robot's units. `options`: when
    circles count as moving, how long they are remembered, and how many there may be.
    """

    def __init__(self, problem: NavigationProblem, options: ControllerOptions) -> None:
        unit, speed = unit_length(problem), fastest(problem)[0] or 1.0
        self._range, self._radius = problem.sensor_range, problem.body_radius
        self._dt, self._rounding = problem.dt, ROUNDING * unit
        self._memory, self._most = options.sight.memory, options.obstacles.circles
        sizes = unit, speed, problem.body_radius + problem.margin
        self._follower = Follower(problem.dt, options.tracker, *sizes)

    def see(
        self,
        state: TrackedCircles,
        given: Array,
        scans: Sequence[LaserScan] = (),
        pose: Array | None = None,
        before: LocalMap | None = None,
        noise: float = 0.0,
        driven: float = 0.0,
    ) -> Around:
        """Take in the circles and the scans of a step.

        `state`: updated. `given`: (M, 7). `scans`: seen from the pose. `pose`: (3,) of the robot;
        if it is unknown, nothing counts as within reach. `before`: what the scans before have
        shown. `noise`: by how much poses may err. `driven`: how far the robot drives in a period,
        by which the list may be older than the pose. Returns its things are the very same array if
        all do as given and no pedestrian walks.
        """
        last = state.things
        things, as_given = self._given_again(state, given, pose, noise, driven)
        if as_given and not (scans or len(state.tracks)):
            state.things = things
            return Around(things, 0, NONE_MOVING)
        taken = [] if pose is None else [self._taken_at(scan, pose, before) for scan in scans]
        seen = self._clusters(scans, taken, things)
        follows = not (as_given and state.tracks.scanned.all())
        if follows and state.tracks.scanned.all() and last is not None:
            state.tracks = self._follower.begin(state.tracks, last[:, :SPREAD_RATE], GIVEN)
        followed = things if follows else things[:0]
        circles = np.concatenate([followed[:, :SPREAD_RATE], seen])
        if len(circles) or len(state.tracks):
            sources = np.repeat((GIVEN, SCANNED), (len(followed), len(seen)))
            state.tracks, found = self._follower.follow(state.tracks, circles, sources)
            if follows:
                things = self._as_seen(state, things, found[: len(things)], as_given)
        state.things = things
        return self._walking(state, things, scans, taken, pose, before)

    def _clusters(self, scans: Sequence[LaserScan], taken: Sequence[Array], things: Array) -> Array:
        """Circles (N, 5) that scans show, but for things (M, 7) that were given."""
        found = [
            clusters(scan, at, self._follower.radius)
            for scan, at in zip(scans, taken, strict=False)
        ]
        seen = np.concatenate([np.empty((0, SPREAD_RATE)), *found])
        return _elsewhere(seen, things) if len(things) else seen

    def _as_seen(self, state: TrackedCircles, things: Array, index: Array, as_given: bool) -> Array:
        """Give things (M, 7) with tracks (M,) the velocities that they were seen to have."""
        moves = (index >= 0) & (state.tracks.moving[index] if len(state.tracks) else False)
        if not moves.any():
            if as_given and not state.tracks.scanned.all():
                state.tracks = state.tracks.take(state.tracks.scanned)
            return things
        seen = self._follower.things(state.tracks.take(index[moves]))
        things = things.copy()
        things[moves, VELOCITY.start :] = seen[:, VELOCITY.start :]
        return things

    def _walking(
        self,
        state: TrackedCircles,
        things: Array,
        scans: Sequence[LaserScan],
        taken: Sequence[Array],
        pose: Array | None,
        before: LocalMap | None,
    ) -> Around:
        """Add the pedestrians that walk, as scans show them."""
        tracks = state.tracks
        chosen = np.flatnonzero(tracks.scanned)
        if not len(chosen) or pose is None:
            return Around(things, 0, NONE_MOVING)
        own = tracks.take(chosen)
        free = None if before is None else (lambda p: was_free(before, p, pose[:2]))
        known, perhaps = walking_tracks(own, self._follower, scans, taken, free)
        tracks.rows[chosen] = own.rows
        if not len(known) and not len(perhaps):
            return Around(things, 0, NONE_MOVING)
        walking = self._follower.things(own.take(known))
        if len(things):
            walking = _elsewhere(walking, things)
        unsure = things_of(own.circles[perhaps])
        return Around(np.concatenate([things, walking]), len(walking), unsure)

    def _taken_at(self, scan: LaserScan, pose: Array, before: LocalMap | None) -> Array:
        """Where the robot, that is at a pose (3,) now, was in the middle of a scan."""
        if before is None or not (scan.age or scan.time_increment):
            return pose
        age = 0.5 * float(scan.ages[0] + scan.ages[-1])
        return before.poses_at(np.array(age), self._dt, pose)

    def _given_again(
        self, state: TrackedCircles, given: Array, pose: Array | None, noise: float, driven: float
    ) -> tuple[Array, bool]:
        """Given things (M, 7), with those that stand out of reach; and whether all do as given.

        Always in the same order, so that a list that shrinks is no other map.
        """
        known, unseen = state.things, state.unseen + self._dt
        state.unseen = np.zeros(len(given))
        if known is None:
            return given, True
        expected = known.copy()
        expected[:, PLACE] += self._dt * known[:, VELOCITY]
        if self._range is None or not (len(given) or len(known)):
            return given, len(given) == len(known) and self._agree(given, expected)
        rows, columns = _same(expected, given, SAME_PLACE + noise)
        as_given = len(rows) == len(given) and self._agree(given[columns], expected[rows])
        kept = stand(known) & (unseen <= self._memory)
        if pose is not None:
            away = np.hypot(known[:, 0] - pose[0], known[:, 1] - pose[1])
            reach = self._range - SAME_PLACE - noise - driven
            kept &= away - known[:, 2] - self._radius > reach
        kept[rows], unseen[rows], expected[rows] = True, 0.0, given[columns]
        _keep_latest(kept, unseen, self._most - len(given))
        is_new = np.ones(len(given), dtype=bool)
        is_new[columns] = False
        state.unseen = np.concatenate([unseen[kept], np.zeros(np.count_nonzero(is_new))])
        return np.concatenate([expected[kept], given[is_new]]), as_given

    def _agree(self, given: Array, expected: Array) -> bool:
        """Whether things are where they were expected, to rounding."""
        away = np.abs(given[:, PLACE] - expected[:, PLACE])
        return bool(away.max(initial=0.0) <= self._rounding)


def _elsewhere(circles: Array, things: Array) -> Array:
    """Those of circles (N, 5 or more) that are none of things (M, 7)."""
    gaps = distances(things, circles[:, PLACE], np.zeros(len(circles)))
    chosen: Array = circles[(gaps > circles[:, RADIUS, None]).all(axis=1)]
    return chosen


def _same(known: Array, given: Array, near: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Which known thing (K, 7) is which of the given ones (M, 7): pairs of rows."""
    away = np.abs(known[:, None, : RADIUS + 1] - given[:, : RADIUS + 1]).max(axis=2)
    # a pair that cannot be costs more than all the rest together
    never = (1.0 + min(away.shape)) * near + 1.0
    rows, columns = linear_sum_assignment(np.where(away <= near, away, never))
    same = away[rows, columns] <= near
    return rows[same], columns[same]


def _keep_latest(kept: Array, unseen: Array, most: int) -> None:
    """Of the kept ones (K,) that were not given forget those beyond a number, the oldest."""
    remembered = np.flatnonzero(kept & (unseen > 0.0))
    if len(remembered) > most:
        order = np.argsort(unseen[remembered], kind="stable")
        kept[remembered[order[max(most, 0) :]]] = False
