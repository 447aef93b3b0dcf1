"""What changes around the robot: what scans show, what moves, and poses that jump."""

from __future__ import annotations

from functools import partial

from kmpc_lite.control.answers import Answers
from kmpc_lite.control.estimate.innovation import Innovation, estimate
from kmpc_lite.control.kernels.clearance import VELOCITY
from kmpc_lite.control.now import Now
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.problem import NavigationProblem
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
        from kmpc_lite.control.world.sight import ScanWatch, Sight
        from kmpc_lite.control.world.tracking import Tracking
        from kmpc_lite.control.world.view import View

        self._answers, self._dt = answers, units.dt
        self._innovation = Innovation(units, options.pose)
        self._sight = Sight(units, scale, options.sight, reach)
        self._view = partial(View, self._sight)
        self._scans = ScanWatch(units, options.sight, units.dt * scale.time)
        self._tracking = Tracking(units, options)
        self._weighs = options.pose.weighed

    def watch(self, now: Now) -> None:
        """Compare pose and circles with what was expected of them.

        A pose that has jumped stops the robot, and the predicted one is put in its place; so do
        scanners that tell nothing any more. Circles are followed (`Tracking`), but for a controller
        without margins, as the paper's, which believes what is given.
        """
        state, known = now.state, now.known
        pose = now.pose if now.pose_is_known else None
        if known.margins is None:
            state.history.measured = pose
            return
        if now.pose_is_known and (now.scans or state.scans is not None):
            self._look_out(now)
        found, size = state.innovation, known.margins.noise.pose_errors
        instead = self._innovation.see(found, state.history, known.model, size, pose)
        last, found.estimate = found.estimate, None
        if instead is not None:
            state.circles.pose_jumped()
            now.pose = instead
            now.refusal = now.refusal or self._answers.jump(found.jump)
            return
        if found.elsewhere:
            # the poses stay where they jumped to: what scans showed lies elsewhere now
            state.seen, state.scans, state.circles = None, None, TrackedCircles()
        noise = known.margins.noise.of_pose(found) if self._weighs and pose is not None else None
        if noise is not None:
            found.estimate = estimate(last, state.history.driven, known.model, *noise, now.pose)
            now.measured = now.measured + (found.estimate.pose - now.pose)
            now.pose = found.estimate.pose
        measured = now.measured if now.pose_is_known else None
        driven = abs(float(state.history.command[0])) * self._dt
        around = self._tracking.see(
            state.circles, now.things, now.scans, measured, state.seen, size[0], driven
        )
        now.things, now.scanned, now.perhaps = around.things, around.walking, around.perhaps

    def _look_out(self, now: Now) -> None:
        """Leave out scans that come again; refuse to drive blind."""
        state = now.state
        if state.scans is None:
            from kmpc_lite.control.world.sight import ScanWatchState

            state.scans = ScanWatchState()
        # what is carried along moves, and is neither a pedestrian nor a scanner that hangs
        scans = self._sight.without_robot(now.scans)
        now.scans, blind = self._scans.see(state.scans, scans, now.measured)
        now.refusal = now.refusal or blind

    def look(self, now: Now) -> None:
        """Look around: what scans show, and what they have shown before."""
        state, known = now.state, now.known
        if not now.scans and state.seen is None:
            return
        noise = 0.0 if known.margins is None else known.margins.pose_deviation
        if noise and state.innovation.estimate is not None:
            noise = state.innovation.estimate.deviation
        moving = now.things[now.things[:, VELOCITY].any(axis=1)]
        state.seen = self._sight.look(state.seen, now.scans, now.measured, noise, moving)
        if state.seen is not None:
            now.view = self._view(state.seen, now.here)
            now.nearby = now.view.around(now.nearby)
