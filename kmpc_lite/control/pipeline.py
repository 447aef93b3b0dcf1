"""What a step does, phase by phase: estimate, guide, solve, verify, command.

The pipeline holds what follows from problem and options. What a step was given, what a drive has to
remember and what follows from the model is in `Now`, which every phase gets. All numbers are in the
robot's units.

A robot that answers late goes on for a while as earlier commands, and the last plan, told it: its
path is looked up from there. A reference from where it is would ask it to make up for that at full
speed; one from where it would rest, if nothing followed, would make a slow robot of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.answers import Answers, StandstillWatch
from kmpc_lite.control.clock import LEAST_AFTER_SOLVE, longest_lately
from kmpc_lite.control.estimate.history import Lateness, advance_pose
from kmpc_lite.control.estimate.innovation import Innovation, InnovationState, estimate
from kmpc_lite.control.kernels.records import VELOCITY, later
from kmpc_lite.control.limits import RateLimit
from kmpc_lite.control.nmpc.qp import along, at_rest, one_period_later
from kmpc_lite.control.nmpc.sqp import SQP, SQPResult
from kmpc_lite.control.now import Now
from kmpc_lite.control.options import ControllerOptions, fastest, unit_length
from kmpc_lite.control.path.situation import GuideTask
from kmpc_lite.control.plan import GoalProgress, Plan, PlanStatus, Task
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.safe_motion import Fallback, SafeMotions, Verification, Verified
from kmpc_lite.control.world.scene import Scene, Surroundings
from kmpc_lite.control.world.tracks import TrackedCircles
from kmpc_lite.geometry import wrap
from kmpc_lite.model.arguments import speeds
from kmpc_lite.scale import Scale
from kmpc_lite.types import INPUTS, Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.guide import Guide
    from kmpc_lite.control.path.planner import Planner
    from kmpc_lite.control.path.situation import Guidance


class Guiding:
    """Asks the guide for the reference of a step.

    `units`: in the robot's units. `guide`: finds paths.
    """

    def __init__(self, units: NavigationProblem, guide: Guide | None) -> None:
        self._guide, self._dt = guide, units.dt
        self._inflation, self._stages = units.inflation, units.horizon + 1
        self._rates = RateLimit(units)
        self._deceleration = units.deceleration[[0, -2 if units.wheels.inputs > INPUTS else 0, -1]]

    def reference(self, now: Now, until: float) -> Guidance | None:
        """Find the reference along a path; none without guidance.

        A search is left to the next step at a time `until` [s].
        """
        state, known, history = now.state, now.known, now.state.history
        if self._guide is None or state.guide is None or known.capabilities is None:
            return None
        late, things = known.capabilities.late, now.things
        led = now.here[None]
        if late:
            going_on = np.zeros((late, known.model.inputs))
            if state.trajectory is not None:
                planned = state.trajectory.inputs[1 : late + 1]
                going_on[: len(planned)] = planned
            led = known.model.rollout(now.here, going_on, history.commands)
            things = later(things, late * self._dt)
        rest = None
        if late or self._rates.active:
            still = np.zeros((known.model.history, known.model.inputs))
            braking = np.concatenate([self._rates.ramp(history.command), still])
            rest = known.model.rollout(now.here, braking, history.commands)[-1]
        rolls_on = history.brakes(float(now.here[2]), self._deceleration, rest is not None)
        if now.rolls_on is not None:
            rolls_on += now.rolls_on
        task = GuideTask(
            pose=led[-1],
            goal=now.goal,
            rolls_on=rolls_on,
            circles=things,
            solids=now.solids,
            rest=rest,
            until=until,
            view=now.view,
            speed=float(speeds(history.command)[0]),
            curvature=history.curvature,
            held=now.held,
        )
        guidance = self._guide.reference(state.guide, known.capabilities, task)
        states = guidance.states
        if late:
            states = np.concatenate([led[:-1], states])[: len(states)]
        kept = state.guide.kept_on_the_way(states, self._inflation)
        return guidance._replace(states=states, path_clearance=kept)

    def towards_goal(self, now: Now) -> Array:
        """Give the goal itself as the reference (N + 1, 3), as in the paper, without guidance."""
        here, goal, before = now.here, now.goal, now.state.turn
        turn = wrap(float(goal[2] - here[2]))
        # near a half turn, the side of the step before is kept
        if abs(turn) > 0.75 * math.pi and turn * before < 0.0 and abs(before) > 0.5 * math.pi:
            turn -= math.copysign(math.tau, turn)
        now.state.turn = turn
        return np.tile(np.array([goal[0], goal[1], here[2] + turn]), (self._stages, 1))


def make_guide(
    units: NavigationProblem,
    options: ControllerOptions,
    clock: Callable[[], float],
    planner: Planner | None,
    scale: Scale,
) -> Guide:
    """Make the guide of a robot; arguments in its units, but for the clock [s] and the planner."""
    # here, for its graph search costs as much to import as all the rest
    from kmpc_lite.control.path.guide import Guide
    from kmpc_lite.control.path.planner import InMetres

    own = None if planner is None else InMetres(planner, scale)
    moving = options.moving_obstacles
    return Guide(units, options.guidance, moving, clock, own)


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
        from kmpc_lite.control.world.sight import ScanWatch, Sight, View
        from kmpc_lite.control.world.tracking import Tracking

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


MOTION_TIME = 0.1
"""Over how long the robot's speeds are seen from its poses [s]: noise averages out of more of them,
and a longer one would show what is past."""
REACH_BEYOND_PLAN = 2.0
"""Solids are looked at as far as the fastest plan reaches and this much farther [radii]: for
margins, and because the pose may be wrong."""
LOOKUP_DISTANCE = 2.0
"""Which solids are near is looked up again after the robot has driven this far [radii]."""


class Pipeline:
    """The phases of a step."""

    def __init__(
        self,
        problem: NavigationProblem,
        units: NavigationProblem,
        scale: Scale,
        options: ControllerOptions,
        sqp: SQP,
        guide: Guide | None,
        pose_age: float,
    ) -> None:
        step = options.step
        self._options, self._problem = options, units
        self._sqp, self._pose_age = sqp, pose_age
        self._guiding = Guiding(units, guide)
        self._newest = min(problem.dt / MOTION_TIME, 1.0)
        self._rates, self._lateness = RateLimit(units), Lateness(units, pose_age)
        motions = SafeMotions(units, options.stop)
        self._verification = Verification(units, step, motions)
        self._answers = Answers(problem, scale)
        untold = np.isinf(problem.du_max)  # axes whose ramps nobody told
        self.fallback = Fallback(units, motions, self._verification, untold, self._answers)
        unit = unit_length(units)
        reach = units.horizon * units.dt * fastest(units)[0] + units.robot_radius + units.margin
        reach += REACH_BEYOND_PLAN * unit
        self.scene = Scene(scale.length, reach, LOOKUP_DISTANCE * unit, options.obstacles)
        self._watching = Watching(units, scale, options, reach, self._answers)
        self._standstill = StandstillWatch(units, scale, options.guidance)

    def estimate(self, now: Now) -> None:
        """Place the robot among what is around it."""
        now.place(self.scene)
        self._watching.look(now)
        innovation, margins = now.state.innovation, now.known.margins
        if margins is not None:
            margins.expected_errors.see(innovation, now.state.history.driven)
            now.felt = margins.felt(innovation)
        self._answers.events.drift(innovation.drifting)

    def bring_forward(self, now: Now) -> bool:
        """Note what was really sent in the command history; bring an old pose forward.

        Circles and pose are compared with what was expected of them (`Watching.watch`). Returns
        whether the robot is found to answer later, or sooner, than was thought.
        """
        state, model, changed = now.state, now.known.model, False
        history, lateness, age = state.history, state.lateness, self._pose_age
        if now.sent is not None:
            now.held = bool(history.command.any() and not now.sent.any())
            history.correct(now.sent, self._problem)
        measured = now.pose if now.pose_is_known else None
        history.see(measured, model, self._newest)
        if lateness is not None:
            pose = measured if history.driven is not None else None
            changed = self._lateness.see(lateness, now.known.learned, history.given, pose)
            if changed:
                # the pose that was expected now is one of another age
                history.driven, state.innovation = None, InnovationState()
            age += self._problem.dt * float(lateness.found.min())
        if age:
            measured = now.pose
            now.bring_forward(advance_pose(model, measured, history.given, age))
            if age > self._pose_age:
                now.rolls_on = history.rolls_on(age, measured, now.pose)
        self._watching.watch(now)
        return changed

    def refuse(self, now: Now, refusal: str) -> Plan:
        """Stop in a step that cannot be planned, short of what scans show in it all the same."""
        self._answers.events.refused(refusal)
        if now.pose_is_known and now.state.innovation.believed is None:
            now.place(self.scene)
            self._watching.look(now)
        elif now.state.seen is not None:
            now.state.seen.clock += self._problem.dt  # what was seen is older by a period
        return self.fallback.stop(now, refusal)

    def guide(self, now: Now) -> None:
        """Find the reference along a path; none without guidance."""
        now.clock.lap("estimate")
        until = now.clock.after(self._options.step.guide_share)
        now.guidance = self._guiding.reference(now, until)
        self._answers.events.path(now.guidance is not None and now.guidance.switched)

    def task(self, now: Now) -> Task:
        """Say what is steered for, among what."""
        known, known_range = now.known, self._problem.sensor_range
        history, guidance = now.state.history, now.guidance
        task = Task(
            model=known.model,
            past=history.commands,
            last=history.command,
            around=Surroundings(
                things=now.things,
                nearby=now.nearby,
                perhaps=now.perhaps,
                unsure=now.unsure,
                swerve_time=self._options.stop.swerve_time,
                known=math.inf if known_range is None else known_range + self._problem.body_radius,
            ),
            margins=known.margins,
            felt=now.felt,
            reference=self._guiding.towards_goal(now) if guidance is None else guidance.states,
            to_goal=guidance is None,
            path_clearance=math.inf if guidance is None else guidance.path_clearance,
            late=0 if known.capabilities is None else known.capabilities.late,
            curvature=history.curvature,
            rolls_on=now.rolls_on,
            terminal_share=1.0 if guidance is None else guidance.share_at_goal,
            deadline=now.clock.after(1.0) - max(now.state.after_solve, LEAST_AFTER_SOLVE),
        )
        now.clock.lap("guide")
        return task

    def solve(self, now: Now, task: Task) -> SQPResult:
        """Run the passes of the SQP from the last plan; along the reference if that is new."""
        qp, guidance = self._sqp.qp, now.guidance
        last = None if guidance is not None and guidance.switched else now.state.trajectory
        guess, least = one_period_later(qp, last, now.here), 1
        if guess is None and guidance is None and self._sqp.iterations > 1:
            # straight to the goal may lead through obstacles, and passes end where they began
            guess = at_rest(qp, now.here)
        elif guess is None:
            guess, least = along(qp, task.reference, now.here), 2
        now.clock.lap("shift")
        result = self._sqp.solve(guess, task, least)
        now.clock.add(result.timing)
        now.passes = result.passes
        return result

    def verify(self, now: Now, result: SQPResult, task: Task) -> Verified:
        """Check that the model agrees with the plan, and that the robot can stop after it."""
        state, verified = now.state, self._verification.check(result, now, task)
        state.trajectory = verified.trajectory
        took = now.clock.lap("verify") + LEAST_AFTER_SOLVE
        state.after_solve = longest_lately(state.after_solve, took)
        return verified

    def command(self, now: Now, verified: Verified) -> Plan:
        """Send the first command of a verified plan."""
        trajectory, motion, guidance = verified.trajectory, verified.motion, now.guidance
        assert trajectory is not None and motion is not None
        now.state.history.remember(trajectory.inputs[0], motion)
        states = trajectory.states + (0.0, 0.0, now.turns) if now.turns else trajectory.states
        status = PlanStatus.FEASIBLE if verified.reason else PlanStatus.SOLVED
        reason, progress = verified.reason, GoalProgress.DRIVING
        if guidance is not None:
            reason = "; ".join(filter(None, (guidance.reason, reason)))
            progress = guidance.progress
        told = self._standstill.tell(now, trajectory.inputs[0], reason, progress)
        return self._answers.plan(now, states, trajectory.inputs, status, *told)

    def hold(self, now: Now, guidance: Guidance) -> Plan:
        """Stand at the goal, or as near to it as the area allows."""
        plan, history = at_rest(self._sqp.qp, now.here), now.state.history
        plan.inputs[0] = command = self._rates.limit(plan.inputs[0], history.command)
        if command.any():
            # it still brakes
            plan.states[:] = now.known.model.rollout(now.here, plan.inputs, history.commands)
        now.state.trajectory = plan
        history.remember(command, np.vstack([command, self._rates.ramp(command)]), braked=True)
        states, told = plan.states + (now.pose - now.here), (guidance.reason, guidance.progress)
        return self._answers.plan(now, states, plan.inputs, PlanStatus.SOLVED, *told)
