"""One drive in closed loop, and what became of it."""

from __future__ import annotations

import math
import traceback
from dataclasses import dataclass, field

import numpy as np

import kmpc_lite as kl
from outcomes.lab import footprint_gaps
from outcomes.plant import LOOKS, Array
from outcomes.setup import Moment, Row, Setup

HELD = 1.0  # how long the robot must stay in pose to have arrived [s]
RESTS = 5.0  # after how long at rest without a way to the goal, or held elsewhere, a drive ends [s]
APART = 0.1  # how far apart edges must be for the next contact to count [radii]
PERTURBED = 1e-9
"""Size of what measured poses are changed by to see how chaotic a drive is [radii, rad]."""
CHANGE = 0.1  # least change of a command from one step to the next that counts as chatter [bounds]
GEAR = 0.2  # how far a robot must drive back for a change of gear [radii]


@dataclass
class Trace:
    """A drive step by step."""

    setup: Setup
    poses: list[Array] = field(default_factory=list)  # true ones, at each step and at the end
    path: list[Array] = field(default_factory=list)  # at each sub-sample
    commands: list[Array] = field(default_factory=list)
    plans: list[tuple[str, str, int]] = field(default_factory=list)
    """Status, progress and passes of each step."""
    gaps: list[float] = field(default_factory=list)  # clearance at each sub-sample [m]
    faults: list[str] = field(default_factory=list)
    """Exceptions, commands that are not finite or out of bounds."""
    ended: str = ""
    time: float = math.nan  # until the robot arrived, or the drive ended [s]
    reason: str = ""  # the last one that the controller gave


@dataclass
class Result:
    """What a drive is judged by."""

    name: str
    family: str
    contacts: int
    depth: float  # of the deepest contact [radii]
    ended: str  # ``arrived``, or the progress at the end
    time: float  # [s]
    clearance: float  # least one [radii]
    gears: int  # changes between forwards and backwards
    stopped: float  # share of steps, as of the next two
    fallback: float
    feasible: float
    passes: float  # mean of the SQP passes a step
    jerk: float  # RMS of the change of commands from step to step, as a share of the bounds
    chatter: float
    """Share of steps in which a change is opposite to the one before, both above `CHANGE`."""
    dt: float  # period [s]
    faults: str = ""
    sound: bool = True  # whether poses are exact, and none is lost


def drive_row(row: Row, seed: int = 0, perturbed: int = 0) -> Trace | None:
    """Drive a row; None if its data is missing."""
    setup = row.make(seed)
    if setup is None:
        return None
    trace = Trace(setup)
    try:
        _Loop(setup, seed, perturbed, trace).run()
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        trace.faults.append(f"{type(error).__name__}: {error} ({where.filename}:{where.lineno})")
        trace.ended = trace.ended or "raised"
    return trace


def no_time() -> float:
    """A clock that stands: how long steps take decides nothing."""
    return 0.0


class _Loop:
    def __init__(self, setup: Setup, seed: int, perturbed: int, trace: Trace) -> None:
        self.setup, self.trace = setup, trace
        self.random = np.random.default_rng([seed, 7])
        self.shake = np.random.default_rng([seed, perturbed, 99])
        self.perturbed = PERTURBED if perturbed else 0.0
        problem = setup.problem
        self.radius = problem.robot_radius
        self.bounds = problem.u_min, problem.u_max
        self.controller = kl.Controller(setup.model, problem, **{"clock": no_time, **setup.options})
        self.pose = np.array(setup.start, dtype=float)
        self.sent = np.zeros(problem.wheels.inputs)
        trace.poses.append(self.pose)
        trace.path.append(self.pose)
        noise = 3.0 * np.array(setup.noise)
        self.tolerance = setup.tolerance or (
            max(0.1 * problem.body_radius, noise[0]),
            max(0.1, noise[1]),
        )

    def run(self) -> None:
        """Drive until it has arrived, rests elsewhere for good, or time is up."""
        setup, trace, dt = self.setup, self.trace, self.setup.dt
        inside = rests = 0.0
        arrived = math.nan
        last = max([setup.least, *(begin + dt for begin, _ in setup.goals)])
        for k in range(math.ceil(setup.limit / dt)):
            plan = self._step(k)
            time = (k + 1) * dt
            inside = inside + dt if self._is_there(setup.goal_at(k * dt)) else 0.0
            held = inside >= HELD - 1e-9
            if held and math.isnan(arrived):
                arrived = time - inside
            if not held and inside == 0.0:
                arrived = math.nan
            stands = plan.holding or plan.progress is kl.GoalProgress.UNREACHABLE
            rests = rests + dt if stands and not plan.command.any() else 0.0
            waited = time - last + 1e-9
            if not setup.stays and ((held and waited >= 0.0) or min(rests, waited) >= RESTS):
                break
        progress = plan.progress.value
        trace.ended = "arrived" if inside >= HELD - 1e-9 else progress
        trace.time = arrived if trace.ended == "arrived" else time
        trace.reason = plan.reason

    def _step(self, k: int) -> kl.Plan:
        setup, trace = self.setup, self.trace
        if k in setup.kicks:
            self.pose = self.pose + np.array(setup.kicks[k])
            trace.poses[-1] = trace.path[-1] = self.pose
        if setup.before is not None:
            self.controller = setup.before(k, self.controller) or self.controller
        time = k * setup.dt
        seen = self._seen_pose(time)
        spread = np.array((setup.noise[0], setup.noise[0], setup.noise[1]))
        measured = seen + spread * self.random.normal(size=3)
        if setup.measure is not None:
            measured = setup.measure(k, measured)
        moment = Moment(time, k, seen, setup.scene, self.radius, self.random)
        obstacles = setup.sense(moment)
        if setup.frame is not None:
            frame = setup.frame()
            measured = measured + frame
            obstacles = np.asarray(obstacles) + (*frame[:2], 0.0, 0.0, 0.0)
        size = self.perturbed * np.array((self.radius, self.radius, 1.0))
        measured = measured + size * self.shake.normal(size=3)
        more = {"sent": self.sent} if setup.gate is not None and k else {}
        plan = self.controller.step(measured, setup.goal_at(time), obstacles, **more)
        self._note(k, plan)
        self._move(plan.command)
        return plan

    def _move(self, wanted: Array) -> None:
        setup, trace, dt = self.setup, self.trace, self.setup.dt
        command = np.nan_to_num(np.array(wanted, dtype=float))
        if setup.gate is not None:
            reach = np.array(setup.gate) * dt
            command = self.sent + np.clip(command - self.sent, -reach, reach)
        self.sent = command
        poses = setup.plant.drive(self.pose, command)
        begin = (len(trace.poses) - 1) * dt
        times = begin + dt * np.arange(1, len(poses) + 1) / len(poses)
        trace.gaps.extend(clearances(setup, poses, times).tolist())
        self.pose = poses[-1]
        trace.path.extend(poses)
        trace.poses.append(self.pose)

    def _seen_pose(self, time: float) -> Array:
        """True pose as old as measured ones are."""
        path, place = self.trace.path, LOOKS * max(time - self.setup.pose_age, 0.0) / self.setup.dt
        if not self.setup.pose_age:
            return self.pose
        before = path[min(int(place + 1e-9), len(path) - 1)]
        after = path[min(int(place + 1e-9) + 1, len(path) - 1)]
        pose: Array = before + (place - int(place + 1e-9)) * (after - before)
        return pose

    def _is_there(self, goal: Array) -> bool:
        frame = np.zeros(3) if self.setup.frame is None else self.setup.frame()
        x, y, turn = self.pose + frame - goal
        near, turned = self.tolerance
        return math.hypot(x, y) <= near and abs(math.remainder(turn, math.tau)) <= turned

    def _note(self, k: int, plan: kl.Plan) -> None:
        trace, problem, u = self.trace, self.setup.problem, plan.command
        trace.commands.append(np.array(u, dtype=float))
        trace.plans.append((plan.status.name, plan.progress.value, plan.iterations))
        low, high = self.bounds
        if not np.isfinite(u).all():
            trace.faults.append(f"step {k}: command {u} is not finite")
        elif (u < low - 1e-9).any() or (u > high + 1e-9).any():
            trace.faults.append(f"step {k}: command {u} is out of bounds")
        elif abs(u[0]) + 0.5 * problem.track * abs(u[1]) > problem.max_wheel_speed + 1e-9:
            trace.faults.append(f"step {k}: command {u} is too fast for a wheel")
        elif isinstance(problem.wheels, kl.Car):
            sharpest = abs(u[0]) * problem.wheels.curvature
            if abs(u[1]) > sharpest + 1e-9:
                trace.faults.append(f"step {k}: command {u} turns a car that cannot")


def clearances(setup: Setup, poses: Array, times: Array) -> Array:
    """Distances (n,) of the robot from its nearest obstacle at poses (n, 3) and times (n,) [m]."""
    scene, problem = setup.scene, setup.problem
    circles = [scene.circles_at(time) for time in times.tolist()]
    if problem.footprint is not None:
        rows = np.array(circles).reshape(len(poses), -1, 5)
        return footprint_gaps(problem.footprint, poses, rows, scene.solids)
    still = scene.world.clearance(poses[:, :2], np.zeros(len(poses)))
    moving = np.array(
        [
            (np.hypot(*(rows[:, :2] - pose[:2]).T) - rows[:, 2]).min(initial=np.inf)
            for rows, pose in zip(circles, poses, strict=True)
        ]
    )
    out: Array = np.minimum(still, moving) - problem.robot_radius
    return out


def result_of(row: Row, trace: Trace) -> Result:
    """Measure a drive."""
    setup, gaps = trace.setup, np.array(trace.gaps)
    radius = setup.problem.body_radius
    statuses = [status for status, _, _ in trace.plans] or ["STOPPED"]
    commands = np.array(trace.commands).reshape(-1, setup.problem.wheels.inputs)
    full = np.maximum(np.abs(setup.problem.u_min), np.abs(setup.problem.u_max))
    changes = np.diff(commands, axis=0) / full
    clearance = float(gaps.min(initial=np.inf)) / radius
    passes = [count for _, _, count in trace.plans]
    return Result(
        row.name,
        row.family,
        _contacts(gaps / radius),
        max(-clearance, 0.0),
        trace.ended,
        trace.time,
        clearance,
        _gears(setup.dt * commands[:, 0], GEAR * radius),
        statuses.count("STOPPED") / len(statuses),
        statuses.count("FALLBACK") / len(statuses),
        statuses.count("FEASIBLE") / len(statuses),
        float(np.mean(passes)) if passes else 0.0,
        float(np.sqrt((changes**2).sum(axis=1).mean())) if len(changes) else 0.0,
        _chatter(changes),
        setup.dt,
        "; ".join(trace.faults[:3]),
        not any(setup.noise) and setup.measure is None and not setup.kicks,
    )


def _chatter(changes: Array) -> float:
    """Share of steps at which a command jumps back: changes (T, m) [bounds]."""
    back = changes[1:] * changes[:-1] < 0.0
    large = np.minimum(np.abs(changes[1:]), np.abs(changes[:-1])) > CHANGE
    return float((back & large).any(axis=1).mean()) if len(back) else 0.0


def _contacts(gaps: Array) -> int:
    """How often edges overlap that were apart before."""
    count, touching = 0, False
    for gap in gaps.tolist():
        if gap < 0.0 and not touching:
            count, touching = count + 1, True
        elif gap > APART:
            touching = False
    return count


def _gears(driven: Array, least: float) -> int:
    """How often a robot that drives distances (T,) turns back by a least one [m]."""
    place = farthest = 0.0
    ahead = changes = 0
    for step in driven.tolist():
        place += step
        if ahead == 0 and abs(place) > least:
            ahead, farthest = (1 if place > 0.0 else -1), place
        elif ahead and (place - farthest) * ahead > 0.0:
            farthest = place
        elif ahead and (farthest - place) * ahead > least:
            ahead, farthest, changes = -ahead, place, changes + 1
    return changes
