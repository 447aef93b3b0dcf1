"""Whether what has become known lately stands on the path that is driven."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.path_map import same_solids
from kmpc_lite.control.path.situation import Situation
from kmpc_lite.control.path.state import GuideState
from kmpc_lite.control.path.timed_path import TimedPath
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.types import Array


class PathWatch:
    """Looks along the path that is driven.

    Parameters
    ----------
    problem : NavigationProblem
        Radius, margin, period.
    options : GuidanceOptions
        In metres.
    """

    def __init__(self, problem: NavigationProblem, options: GuidanceOptions) -> None:
        self._options, self._dt = options, problem.dt
        self._inflation = problem.inflation

    def has_grown_elsewhere(self, state: GuideState, now: Situation) -> bool:
        """Whether the map is another one, which leaves the path free: then there is no hurry."""
        path, solids = state.path, now.solids
        if solids is state.solids or path is None or solids is None or state.solids is None:
            return False
        if state.urgent or state.turning or same_solids(solids, state.solids):
            return False
        same_circles = now.circles.tobytes() == state.circles_at_rest
        if now.target.tolist() != state.goal.tolist() or not same_circles:
            return False
        if path.drive_end - state.place > self._longest:
            return False  # more than can be looked at in a step
        points = self._points_ahead(state, now, path)
        return not len(points) or bool((solids.whole.least(points) >= self._inflation).all())

    def is_to_be_renewed(self, state: GuideState, now: Situation) -> bool:
        """Whether to look if what was in the way has gone."""
        if now.view is None or state.path is None or state.turning:
            return False
        return now.distance > self._options.near_goal and state.age > now.view.refresh_interval

    def watch_path(self, state: GuideState, now: Situation) -> bool:
        """Look at times whether something that scans have shown lately stands on the path."""
        view, path = now.view, state.path
        if view is None or path is None or state.turning:
            return False
        state.unwatched += self._dt
        if state.unwatched < view.blocked_interval or state.age <= self._options.replan_interval:
            return False
        state.unwatched = 0.0
        return view.blocks(self._points_ahead(state, now, path), self._inflation)

    def lead(self, state: GuideState, now: Situation) -> float:
        """How long the robot drives on while a path is looked for [s].

        As long as searches take, or half as long where something stands on the path before that;
        not at all where it stands nearer, or where nothing is seen.
        """
        view, path = now.view, state.path
        if view is None or path is None or state.turning:
            return 0.0
        for lead in (state.search_time, 0.5 * state.search_time):
            end = min(state.place + lead, path.drive_end)
            points = path.at(np.arange(state.place, end, self._options.grid_step))[:, :2]
            if not view.blocks(points, self._inflation):
                return end - state.place
        return 0.0

    @property
    def _longest(self) -> float:
        """Time of the longest path that can be looked at in a step [s]."""
        return self._options.grid_step * self._options.lattice_nodes

    def _points_ahead(self, state: GuideState, now: Situation, path: TimedPath) -> Array:
        """Points (n, 2) of the path that is left, but for where the robot is and is to stand.

        There it may come as near to things as it must. Of a path longer than can be looked at in a
        step the beginning is given.
        """
        end = min(path.drive_end, state.place + self._longest)
        points = path.at(np.arange(state.place, end, self._options.grid_step))[:, :2]
        ends = [np.hypot(*(points - pose[:2]).T) for pose in (now.pose, now.goal)]
        ahead: Array = points[np.minimum(*ends) > self._inflation]
        return ahead
