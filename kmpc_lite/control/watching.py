"""What changes around the robot: what scans show, who moves, and poses that jump."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.answers import Answers
from kmpc_lite.control.estimate.innovation import Innovation
from kmpc_lite.control.kernels.clearance import VELOCITY
from kmpc_lite.control.knowledge import Knowledge
from kmpc_lite.control.observation import Observation
from kmpc_lite.control.options import ControllerOptions, fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.state import ControllerState
from kmpc_lite.control.world.given_circles import CircleMemory, GivenCircles, MotionWatch
from kmpc_lite.control.world.tracks import Tracks
from kmpc_lite.scale import Scale


class Watching:
    """Looks around before a step is planned.

    Parameters
    ----------
    units : NavigationProblem
        In the robot's units.
    scale : Scale
        The robot's units.
    options : ControllerOptions
        Of sight, tracker and pose, and of which circle is which.
    reach : float
        How far from the robot things count, in units.
    answers : Answers
        Tells jumps in metres.
    """

    def __init__(
        self,
        units: NavigationProblem,
        scale: Scale,
        options: ControllerOptions,
        reach: float,
        answers: Answers,
    ) -> None:
        # here, for importing the package has no need of them, and no step has time to
        from kmpc_lite.control.world.sight.scan_watch import ScanWatch
        from kmpc_lite.control.world.sight.sight import Sight
        from kmpc_lite.control.world.walkers import Walkers

        self._answers, self._dt = answers, units.dt
        self._innovation = Innovation(units, options.pose)
        speed = fastest(units)[0] or 1.0
        spread_max = units.body_radius + units.margin
        self._motion = MotionWatch(units.dt, options.tracker, unit_length(units), speed, spread_max)
        self._memory = CircleMemory(units, options)
        self._sight = Sight(units, scale, options.sight, reach)
        self._scans = ScanWatch(units, options.sight, units.dt * scale.time)
        self._walkers = Walkers(units.dt * scale.time, options.tracker, scale, spread_max)

    def watch(self, state: ControllerState, seen: Observation, known: Knowledge) -> None:
        """Compare circles and pose with what was expected of them.

        Circles that move otherwise than told get the velocity that they were seen to have. A pose
        that has jumped stops the robot, and the predicted one is put in its place; so do scanners
        that tell nothing any more. Circles that stand out of reach are added to those that are told
        (`CircleMemory`). Controllers without margins, as the paper's, believe what they are told.
        """
        pose = seen.pose if seen.pose_is_known else None
        if known.margins is None:
            state.history.measured = pose
            return
        seen.things = self._motion.see(state.circles, seen.things)
        if seen.pose_is_known and (seen.scans or state.scans is not None):
            self._look_out(state, seen)
            self._find_walkers(state, seen)
        noise, found = known.margins.noise, state.innovation
        size = noise.pose_errors
        instead = self._innovation.see(found, state.history, known.model, size, pose)
        if instead is not None:
            # circles that are seen from a pose that jumped have jumped, too
            self._motion.forget(state.circles)
            state.walkers = None
            seen.pose = instead
            seen.refusal = seen.refusal or self._answers.jump(found.jump)
        elif found.elsewhere:
            # the poses stay where they jumped to: what scans showed lies elsewhere now
            state.seen, state.scans, state.circles = None, None, GivenCircles()
        if not seen.refusal and seen.pose_is_known:
            driven = abs(float(state.history.command[0])) * self._dt
            seen.things = self._memory.recall(
                state.circles, seen.things, seen.measured, noise.pose_errors[0], driven
            )

    def _look_out(self, state: ControllerState, seen: Observation) -> None:
        """Leave out scans that come again; refuse to drive blind."""
        if state.scans is None:
            from kmpc_lite.control.world.sight.scan_watch import ScanWatchState

            state.scans = ScanWatchState()
        # what is carried along moves, and is neither somebody nor a scanner that hangs
        scans = self._sight.without_robot(seen.scans)
        seen.scans, blind = self._scans.see(state.scans, scans, seen.measured)
        seen.refusal = seen.refusal or blind

    def _find_walkers(self, state: ControllerState, seen: Observation) -> None:
        """Add who walks, as scans show it, to the circles."""
        before = Tracks() if state.walkers is None else state.walkers
        state.walkers, walking, seen.perhaps = self._walkers.see(
            before, seen.scans, seen.measured, seen.things, state.seen
        )
        seen.scanned = len(walking)
        seen.things = np.concatenate([seen.things, walking])

    def wait(self, state: ControllerState) -> None:
        """Let a period pass without a look around: what was seen is older by it."""
        if state.seen is not None:
            state.seen.clock += self._dt

    def look(self, state: ControllerState, seen: Observation, known: Knowledge) -> None:
        """Look around: what scans show, and what they have shown before."""
        if not seen.scans and state.seen is None:
            return
        noise = 0.0 if known.margins is None else known.margins.tightening.pose_deviation
        moving = seen.things[seen.things[:, VELOCITY].any(axis=1)]
        state.seen = self._sight.look(state.seen, seen.scans, seen.measured, noise, moving)
        if state.seen is not None:
            seen.view = self._sight.view(state.seen, seen.here)
            seen.nearby = seen.view.around(seen.nearby)
