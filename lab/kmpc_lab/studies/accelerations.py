"""``kmpc study limits``: robots with real accelerations, among circles, from slow to quick ones.

A row is a robot of a speed and two accelerations in a field of 15 to 25 circles, which are known,
or reported within a reach. The controller is given the accelerations with the nominal model, or has
learned them from a log of two minutes. In pose means within `in_pose` by the true pose for a
second; the ideal time is that of the straight line from rest to rest, and of turns on the spot at
its ends, with the same accelerations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from kmpc_lab.sim.periods import periods
from kmpc_lab.studies.any_robot import Robot, RobotPlant, learn
from kmpc_lab.studies.records import Work
from kmpc_lite.control import Circle, Controller, NavigationProblem
from kmpc_lite.control.plan import Plan, PlanStatus
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.nominal import nominal_unicycle
from kmpc_lite.scenario.arrival import in_pose
from kmpc_lite.types import Array

ROBOTS = {
    f"{speed:g} m/s, {ramp:g} m/s^2, {turn:g} rad/s^2": (speed, ramp, turn)
    for speed, ramp, turn in (
        (0.3, 0.3, 1.0),
        (0.6, 0.4, 2.0),
        (1.0, 0.5, 1.5),
        (1.5, 1.5, 5.0),
        (1.5, 5.0, 10.0),
        (3.0, 1.0, 3.0),
        (4.0, 0.3, 1.0),
        (4.0, 5.0, 10.0),
    )
}
"""Speeds, accelerations and turn accelerations."""
KNOWS = "given", "learned"
REACHES = 0.0, 2.0
"""How far away circles are reported [m]; 0: all of them."""
FASTEST_TURN = 2.0
"""[rad/s]"""
SIDE, RADIUS = (8.0, 24.0), (0.15, 0.3)
"""Of the field and of the robot [m], up to the next speed and beyond it."""
QUICK = 2.0
"""Speed from which on fields and robots are larger [m/s]."""
GAP = 3.0
"""Least gap between circles [radii of the robot]: it can drive through all of them."""
HELD = 1.0
"""How long a goal must be held [s]."""
SLIP = 0.05


@dataclass(frozen=True)
class LimitedDrive:
    """What became of one drive."""

    robot: str
    knows: str
    reach: float
    seed: int
    in_pose: bool
    collided: bool
    seconds: float
    ideal_seconds: float
    clearance: float
    fastest: float
    """Speed that it drove [m/s]."""
    stopped: float
    """Share of steps STOPPED or FALLBACK."""
    feasible: float
    jerk: float
    """RMS of the change of commands, as a share of the bounds."""
    ended: str


def robot_of(name: str) -> Robot:
    """Robot of a row, with how long it takes from rest to its fastest commands."""
    speed, ramp, turn = ROBOTS[name]
    turn_rate = min(math.pi / 4 * speed / 0.6, FASTEST_TURN)
    times = speed / ramp, turn_rate / turn
    return Robot(
        name,
        RADIUS[speed >= QUICK],
        speed,
        turn_rate,
        ramps=(times[0], times[0]),
        turn_ramp=times[1],
        slip=SLIP,
        seconds=max(120.0, 20.0 * max(times)),
    )


@cache
def model_of(name: str, knows: str) -> KoopmanModel:
    """Model of a row's robot."""
    robot = robot_of(name)
    return learn(robot, 0) if knows == "learned" else nominal_unicycle(robot.dt)


def field(robot: Robot, side: float, seed: int) -> tuple[Array, Array, Array]:
    """Start (3,), goal (3,) and circles (M, 3) of a field."""
    random, half = np.random.default_rng([seed, 71]), 0.5 * side
    start, goal = (
        np.array((way * half, 0.6 * half * random.uniform(-1, 1), random.uniform(-3, 3)))
        for way in (-0.8, 0.8)
    )
    gap, circles = GAP * robot.radius, np.empty((0, 3))
    for _ in range(200 * (count := int(random.integers(15, 26)))):
        if len(circles) == count:
            break
        x, y = 0.85 * half * random.uniform(-1, 1, 2)
        radius = random.uniform(robot.radius, 0.06 * side)
        others = np.vstack([circles, (*start[:2], 0.0), (*goal[:2], 0.0)])
        if (np.hypot(*(others[:, :2] - (x, y)).T) >= others[:, 2] + radius + gap).all():
            circles = np.vstack([circles, (x, y, radius)])
    return start, goal, circles


def problem_of(robot: Robot, side: float, knows: str, reach: float) -> NavigationProblem:
    """Problem of a row: its limits are given if they are not learned."""
    _, ramp, turn = ROBOTS[robot.name]
    half, free = 0.5 * side, knows == "learned"
    return NavigationProblem(
        dt=robot.dt,
        u_min=(-robot.speed, -robot.turn_rate),
        u_max=(robot.speed, robot.turn_rate),
        x_min=(-half, -half, -np.inf),
        x_max=(half, half, np.inf),
        robot_radius=robot.radius,
        sensor_range=reach or None,
        du_max=(np.inf, np.inf) if free else (ramp, turn),
        deceleration=None if free else (ramp, turn),
    )


def ideal_seconds(name: str, start: Array, goal: Array) -> float:
    """Turn, straight line, turn, each from rest to rest as quickly as the robot can."""
    _, ramp, turn = ROBOTS[name]
    robot, away = robot_of(name), goal[:2] - start[:2]
    along = math.atan2(away[1], away[0])

    def time(far: float, fastest: float, change: float) -> float:
        ramped = fastest**2 / change
        return 2.0 * math.sqrt(far / change) if far < ramped else far / fastest + fastest / change

    turns = (
        [
            abs(math.remainder(a, math.tau))
            for a in (along + back - start[2], goal[2] - along - back)
        ]
        for back in (0.0, math.pi)
    )
    quickest = min(sum(time(angle, robot.turn_rate, turn) for angle in both) for both in turns)
    return time(math.hypot(*away), robot.speed, ramp) + quickest


def drive(name: str, knows: str, reach: float, seed: int) -> LimitedDrive:
    """Drive one field."""
    robot = robot_of(name)
    side = SIDE[robot.speed >= QUICK]
    start, goal, circles = field(robot, side, seed)
    controller = Controller(model_of(name, knows), problem_of(robot, side, knows, reach))
    ideal, tolerance = ideal_seconds(name, start, goal), in_pose(robot.radius, np.zeros(3))

    def step(pose: Array, k: int) -> Plan:
        gaps = np.hypot(*(circles[:, :2] - pose[:2]).T) - circles[:, 2] - robot.radius
        return controller.step(pose, goal, [Circle(*c) for c in circles[gaps <= (reach or np.inf)]])

    inside, clearance, statuses, commands = 0.0, np.inf, [], []
    most = math.ceil((5.0 * ideal + 20.0) / robot.dt)
    for period in periods(step, RobotPlant(robot, seed).drive, start, most):
        plan, poses = period.plan, period.poses
        statuses.append(plan.status)
        commands.append(plan.command / (robot.speed, robot.turn_rate))
        away = np.hypot(*np.moveaxis(poses[:, None, :2] - circles[:, :2], -1, 0)) - circles[:, 2]
        clearance = min(clearance, float(away.min()) - robot.radius)
        inside = inside + robot.dt if tolerance.met(poses[-1], goal) else 0.0
        if clearance < 0.0 or inside >= HELD:
            break
    driven = np.array(commands)
    waits = sum(s in (PlanStatus.STOPPED, PlanStatus.FALLBACK) for s in statuses)
    return LimitedDrive(
        name,
        knows,
        reach,
        seed,
        inside >= HELD,
        clearance < 0.0,
        len(statuses) * robot.dt - inside,
        ideal,
        clearance,
        float(np.abs(driven[:, 0]).max()) * robot.speed,
        waits / len(statuses),
        statuses.count(PlanStatus.FEASIBLE) / len(statuses),
        float(np.sqrt((np.diff(driven, axis=0) ** 2).sum(axis=1).mean())),
        f"{plan.progress.value}: {plan.reason}" if plan.reason else plan.progress.value,
    )


def study(
    work: Work, names: Sequence[str], seeds: Sequence[int], reaches: Sequence[float] = REACHES
) -> list[LimitedDrive]:
    """Drive all robots, with what is given and what is learned, by what is known and by sight."""
    return work.rows("limits", product(names, reaches, KNOWS, seeds), _drive, LimitedDrive)


def _drive(name: str, reach: float, knows: str, seed: int) -> LimitedDrive:
    return drive(name, knows, reach, seed)


def summary(rows: Sequence[LimitedDrive]) -> dict[str, Any]:
    """Counts and medians of drives."""
    times = [row.seconds / row.ideal_seconds for row in rows if row.in_pose]
    return {
        "drives": len(rows),
        "in_pose": sum(row.in_pose for row in rows),
        "collisions": sum(row.collided for row in rows),
        "time_to_ideal": float(np.median(times)) if times else math.nan,
        "stopped": float(np.mean([row.stopped for row in rows])),
        "feasible": float(np.mean([row.feasible for row in rows])),
        "jerk": float(np.mean([row.jerk for row in rows])),
        "clearance": min(row.clearance for row in rows),
        "fastest": float(np.mean([row.fastest for row in rows])),
    }


def learned_to_given(rows: Sequence[LimitedDrive]) -> float:
    """Median of the times with a learned model to those with limits given, of the same fields."""
    by = {(r.robot, r.reach, r.seed, r.knows): r.seconds for r in rows if r.in_pose}
    pairs = [(key[:3], time) for key, time in by.items() if key[3] == "learned"]
    ratios = [time / by[*key, "given"] for key, time in pairs if (*key, "given") in by]
    return float(np.median(ratios)) if ratios else math.nan


def format_rows(rows: Sequence[LimitedDrive]) -> str:
    """Table, and every drive that touched or did not end in pose."""
    lines = [
        f"{'':32} {'knows':8} reach drives in pose hit  time/ideal  FALLBACK, STOPPED  FEASIBLE"
        "   jerk  least gap  fastest  learned/given"
    ]
    for name, reach, knows in dict.fromkeys((r.robot, r.reach, r.knows) for r in rows):
        both = [row for row in rows if (row.robot, row.reach) == (name, reach)]
        s = summary([row for row in both if row.knows == knows])
        lines.append(
            f"{name:32} {knows:8} {reach or math.inf:5g} {s['drives']:6d} {s['in_pose']:7d} "
            f"{s['collisions']:3d} {s['time_to_ideal']:11.2f} {100 * s['stopped']:17.1f}% "
            f"{100 * s['feasible']:8.1f}% {s['jerk']:6.3f} {s['clearance']:8.2f} m "
            f"{s['fastest']:8.2f} "
            + (f"{learned_to_given(both):14.2f}" if knows != "given" else "")
        )
    lines += [
        f"{row.robot}, {row.knows}, reach {row.reach or math.inf:g} m, field {row.seed}: "
        + ("touched" if row.collided else row.ended)
        for row in rows
        if row.collided or not row.in_pose
    ]
    return "\n".join(line.rstrip() for line in lines)
