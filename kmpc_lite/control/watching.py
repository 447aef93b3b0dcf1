"""What changes around the robot: what scans show, what moves, and poses that jump."""

from __future__ import annotations

from functools import partial

from kmpc_lite.control.answers import Answers
from kmpc_lite.control.estimate.innovation import Innovation
from kmpc_lite.control.estimate.pose_filter import estimate
from kmpc_lite.control.kernels.clearance import VELOCITY
from kmpc_lite.control.knowledge import Knowledge
from kmpc_lite.control.observation import Observation
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.state import ControllerState
from kmpc_lite.control.world.tracks import TrackedCircles
from kmpc_lite.scale import Scale


class Watching:
    """Looks around before a step is planned."""

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
        from kmpc_lite.control.world.sight.view import View
        from kmpc_lite.control.world.tracking import Tracking

        self._answers, self._dt = answers, units.dt
        self._innovation = Innovation(units, options.pose)
        self._sight = Sight(units, scale, options.sight, reach)
        self._view = partial(View, self._sight)
        self._scans = ScanWatch(units, options.sight, units.dt * scale.time)
        self._tracking = Tracking(units, options)
        self._weighs = options.pose.weighed

    def watch(self, state: ControllerState, seen: Observation, known: Knowledge) -> None:
        """Compare pose and circles with what was expected of them.

        A pose that has jumped stops the robot, and the predicted one is put in its place; so do
        scanners that tell nothing any more. Circles are followed (`Tracking`), but for a controller
        without margins, as the paper's, which believes what is given.
        """
        pose = seen.pose if seen.pose_is_known else None
        if known.margins is None:
            state.history.measured = pose
            return
        if seen.pose_is_known and (seen.scans or state.scans is not None):
            self._look_out(state, seen)
        found, size = state.innovation, known.margins.noise.pose_errors
        instead = self._innovation.see(found, state.history, known.model, size, pose)
        last, found.estimate = found.estimate, None
        if instead is not None:
            state.circles.pose_jumped()
            seen.pose = instead
            seen.refusal = seen.refusal or self._answers.jump(found.jump)
            return
        if found.elsewhere:
            # the poses stay where they jumped to: what scans showed lies elsewhere now
            state.seen, state.scans, state.circles = None, None, TrackedCircles()
        noise = known.margins.noise.of_pose(found) if self._weighs and pose is not None else None
        if noise is not None:
            found.estimate = estimate(last, state.history.driven, known.model, *noise, seen.pose)
            seen.correct(found.estimate.pose)
        measured = seen.measured if seen.pose_is_known else None
        driven = abs(float(state.history.command[0])) * self._dt
        around = self._tracking.see(
            state.circles, seen.things, seen.scans, measured, state.seen, size[0], driven
        )
        seen.things, seen.scanned, seen.perhaps = around.things, around.walking, around.perhaps

    def _look_out(self, state: ControllerState, seen: Observation) -> None:
        """Leave out scans that come again; refuse to drive blind."""
        if state.scans is None:
            from kmpc_lite.control.world.sight.scan_watch import ScanWatchState

            state.scans = ScanWatchState()
        # what is carried along moves, and is neither a pedestrian nor a scanner that hangs
        scans = self._sight.without_robot(seen.scans)
        seen.scans, blind = self._scans.see(state.scans, scans, seen.measured)
        seen.refusal = seen.refusal or blind

    def wait(self, state: ControllerState) -> None:
        """Let a period pass without a look around: what was seen is older by it."""
        if state.seen is not None:
            state.seen.clock += self._dt

    def look(self, state: ControllerState, seen: Observation, known: Knowledge) -> None:
        """Look around: what scans show, and what they have shown before."""
        if not seen.scans and state.seen is None:
            return
        noise = 0.0 if known.margins is None else known.margins.pose_deviation
        if noise and state.innovation.estimate is not None:
            noise = state.innovation.estimate.deviation
        moving = seen.things[seen.things[:, VELOCITY].any(axis=1)]
        state.seen = self._sight.look(state.seen, seen.scans, seen.measured, noise, moving)
        if state.seen is not None:
            seen.view = self._view(state.seen, seen.here)
            seen.nearby = seen.view.around(seen.nearby)
