"""What a step does, phase by phase: estimate, guide, solve, verify, command.

The pipeline holds what follows from problem and options. What a drive has to remember lies in the
`ControllerState`, what follows from the model in `Knowledge`; every phase gets both. All numbers
are in the robot's units.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.answers import Answers
from kmpc_lite.control.estimate.history import advance_pose
from kmpc_lite.control.estimate.innovation import InnovationState
from kmpc_lite.control.estimate.lateness import Lateness
from kmpc_lite.control.fallback import Fallback
from kmpc_lite.control.guiding import Guiding
from kmpc_lite.control.knowledge import Knowledge
from kmpc_lite.control.lately import longest_lately
from kmpc_lite.control.nmpc.sqp import SQP, SQPResult
from kmpc_lite.control.nmpc.trajectory import along, at_rest, one_period_later
from kmpc_lite.control.observation import Observation
from kmpc_lite.control.options import ControllerOptions, fastest, unit_length
from kmpc_lite.control.plan import GoalProgress, Plan, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.control.standstill import StandstillWatch
from kmpc_lite.control.state import ControllerState
from kmpc_lite.control.step_clock import LEAST_AFTER_SOLVE, StepClock
from kmpc_lite.control.stop.safe_motion import SafeMotions
from kmpc_lite.control.task import Task
from kmpc_lite.control.verification import Verification, Verified
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

    def estimate(self, state: ControllerState, seen: Observation, known: Knowledge) -> None:
        """Place the robot among what is around it."""
        seen.place(self.scene, state.scene)
        self._watching.look(state, seen, known)
        innovation, margins = state.innovation, known.margins
        if margins is not None:
            margins.expected_errors.see(innovation, state.history.driven)
            seen.felt = margins.felt(innovation)
        self._answers.events.drift(innovation.drifting)

    def bring_forward(self, state: ControllerState, seen: Observation, known: Knowledge) -> bool:
        """Note what was really sent in the command history; bring an old pose forward.

        Circles and pose are compared with what was expected of them (`Watching.watch`). Returns
        whether the robot is found to answer later, or sooner, than was thought.
        """
        history, changed = state.history, False
        if seen.sent is not None:
            history.correct(seen.sent, self._problem)
        measured = seen.pose if seen.pose_is_known else None
        history.see(measured, known.model, self._newest)
        age, lateness = self._pose_age, state.lateness
        if lateness is not None:
            pose = measured if history.driven is not None else None
            changed = self._lateness.see(lateness, known.model, history.given, pose)
            if changed:
                # the pose that was expected now is one of another age
                history.driven, state.innovation = None, InnovationState()
            age += self._problem.dt * float(lateness.found.min())
        if age:
            measured = seen.pose
            seen.bring_forward(advance_pose(known.model, measured, history.given, age))
            if age > self._pose_age:
                seen.rolls_on = history.rolls_on(age, measured, seen.pose)
        self._watching.watch(state, seen, known)
        return changed

    def refuse(
        self,
        state: ControllerState,
        seen: Observation,
        known: Knowledge,
        refusal: str,
        clock: StepClock,
    ) -> Plan:
        """Stop in a step that cannot be planned, short of what scans show in it all the same."""
        self._answers.events.refused(refusal)
        if seen.pose_is_known and state.innovation.believed is None:
            seen.place(self.scene, state.scene)
            self._watching.look(state, seen, known)
        else:
            self._watching.wait(state)
        return self.fallback.stop(state, seen, known, refusal, clock)

    def guide(
        self, state: ControllerState, seen: Observation, known: Knowledge, clock: StepClock
    ) -> Guidance | None:
        """Find the reference along a path; none without guidance."""
        clock.lap("estimate")
        until = clock.after(self._options.step.guide_share)
        guidance = self._guiding.reference(state, seen, known, until)
        self._answers.events.path(guidance is not None and guidance.switched)
        return guidance

    def task(
        self,
        state: ControllerState,
        seen: Observation,
        guidance: Guidance | None,
        known: Knowledge,
        clock: StepClock,
    ) -> Task:
        """Say what is steered for, among what."""
        known_range = self._problem.sensor_range
        task = Task(
            model=known.model,
            past=state.history.commands,
            last=state.history.command,
            around=Surroundings(
                things=seen.things,
                nearby=seen.nearby,
                perhaps=seen.perhaps,
                unsure=seen.unsure,
                swerve_time=self._options.stop.swerve_time,
                known=math.inf if known_range is None else known_range + self._problem.body_radius,
                emerging_speed=self._emerging_speed,
                unknown=seen.view.unknown if seen.view and self._emerging_speed else None,
            ),
            margins=known.margins,
            felt=seen.felt,
            reference=self._guiding.towards_goal(state, seen)
            if guidance is None
            else guidance.states,
            to_goal=guidance is None,
            path_clearance=math.inf if guidance is None else guidance.path_clearance,
            late=0 if known.capabilities is None else known.capabilities.late,
            curvature=state.history.curvature,
            rolls_on=seen.rolls_on,
            terminal_share=1.0 if guidance is None else guidance.share_at_goal,
            deadline=clock.deadline(max(state.after_solve, LEAST_AFTER_SOLVE)),
        )
        clock.lap("guide")
        return task

    def solve(
        self,
        state: ControllerState,
        seen: Observation,
        guidance: Guidance | None,
        task: Task,
        clock: StepClock,
    ) -> SQPResult:
        """Run the passes of the SQP from the last plan; along the reference if that is new."""
        qp = self._sqp.qp
        last = None if guidance is not None and guidance.switched else state.trajectory
        guess, least = one_period_later(qp, last, seen.here), 1
        if guess is None and guidance is None and self._sqp.iterations > 1:
            # straight to the goal may lead through obstacles, and passes end where they began
            guess = at_rest(qp, seen.here)
        elif guess is None:
            guess, least = along(qp, task.reference, seen.here), 2
        clock.lap("shift")
        result = self._sqp.solve(guess, task, least)
        clock.add(result.timing)
        return result

    def verify(
        self,
        state: ControllerState,
        seen: Observation,
        result: SQPResult,
        task: Task,
        clock: StepClock,
    ) -> Verified:
        """Check that the model agrees with the plan, and that the robot can stop after it."""
        verified = self._verification.check(result, seen, task)
        state.trajectory = verified.trajectory
        took = clock.lap("verify") + LEAST_AFTER_SOLVE
        state.after_solve = longest_lately(state.after_solve, took)
        return verified

    def command(
        self,
        state: ControllerState,
        seen: Observation,
        guidance: Guidance | None,
        verified: Verified,
        passes: int,
        clock: StepClock,
    ) -> Plan:
        """Send the first command of a verified plan."""
        trajectory, motion = verified.trajectory, verified.motion
        assert trajectory is not None and motion is not None
        state.history.remember(trajectory.inputs[0], motion, planned=True)
        states = trajectory.states + (0.0, 0.0, seen.turns) if seen.turns else trajectory.states
        status = PlanStatus.FEASIBLE if verified.reason else PlanStatus.SOLVED
        reason, reachable, progress = verified.reason, True, GoalProgress.DRIVING
        if guidance is not None:
            reason = "; ".join(filter(None, (guidance.reason, reason)))
            reachable, progress = guidance.reachable, guidance.progress
        told = trajectory.inputs[0], guidance is not None, reason, progress
        reason, progress = self._standstill.tell(state.standstill, seen.here, seen.goal, *told)
        return self._answers.plan(
            seen,
            states,
            trajectory.inputs,
            status,
            clock,
            passes=passes,
            reason=reason,
            reachable=reachable,
            progress=progress,
        )

    def hold(
        self,
        state: ControllerState,
        seen: Observation,
        guidance: Guidance,
        known: Knowledge,
        clock: StepClock,
    ) -> Plan:
        """Stand at the goal, or as near to it as the area allows."""
        plan, history = at_rest(self._sqp.qp, seen.here), state.history
        plan.inputs[0] = command = self._rates.limit(plan.inputs[0], history.command)
        if command.any():
            # it still brakes
            plan.states[:] = known.model.rollout(seen.here, plan.inputs, history.commands)
        state.trajectory = plan
        history.remember(command, np.vstack([command, self._rates.ramp(command)]))
        return self._answers.plan(
            seen,
            plan.states + (seen.pose - seen.here),
            plan.inputs,
            PlanStatus.SOLVED,
            clock,
            reason=guidance.reason,
            reachable=guidance.reachable,
            progress=guidance.progress,
        )
