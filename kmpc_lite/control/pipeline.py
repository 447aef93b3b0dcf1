"""What a step does, phase by phase: estimate, guide, solve, verify, command.

The pipeline holds what follows from problem and options. What a step was given, what a drive has to
remember and what follows from the model is in `Now`, which every phase gets. All numbers are in the
robot's units.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.answers import Answers, StandstillWatch
from kmpc_lite.control.clock import LEAST_AFTER_SOLVE, longest_lately
from kmpc_lite.control.estimate.expected_errors import Lateness
from kmpc_lite.control.estimate.history import advance_pose
from kmpc_lite.control.estimate.innovation import InnovationState
from kmpc_lite.control.guiding import Guiding
from kmpc_lite.control.limits import RateLimit
from kmpc_lite.control.nmpc.sqp import SQP, SQPResult
from kmpc_lite.control.nmpc.trajectory import along, at_rest, one_period_later
from kmpc_lite.control.now import Now
from kmpc_lite.control.options import ControllerOptions, fastest, unit_length
from kmpc_lite.control.plan import GoalProgress, Plan, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.safe_motion import SafeMotions
from kmpc_lite.control.task import Task
from kmpc_lite.control.verification import Fallback, Verification, Verified
from kmpc_lite.control.watching import Watching
from kmpc_lite.control.world.scene import Scene
from kmpc_lite.control.world.surroundings import Surroundings
from kmpc_lite.scale import Scale

if TYPE_CHECKING:
    from kmpc_lite.control.path.guide import Guide
    from kmpc_lite.control.path.situation import Guidance

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
        self._emerging_speed = options.sight.emerging_speed / scale.speed
        motions = SafeMotions(units, options.stop)
        self._verification = Verification(units, step, motions)
        self._answers = Answers(problem, scale)
        self.fallback = Fallback(units, motions, self._verification, self._rates, self._answers)
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
            history.correct(now.sent, self._problem)
        measured = now.pose if now.pose_is_known else None
        history.see(measured, model, self._newest)
        if lateness is not None:
            pose = measured if history.driven is not None else None
            changed = self._lateness.see(lateness, model, history.given, pose)
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
                emerging_speed=self._emerging_speed,
                unknown=now.view.unknown if now.view and self._emerging_speed else None,
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
