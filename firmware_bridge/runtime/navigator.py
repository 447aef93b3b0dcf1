"""Makes a planner the bridge's controller, and watches goal and obstacles.

Goals come one after the other: the next one is given when the last one is held.
"""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from firmware_bridge.messages import STILL, Speeds, State, VelocityCommand

Pose = tuple[float, float, float]
SHOWN = 10  # goals of a route that are still reported once they are held
PARTS = 4  # places between two poses at which the distance to obstacles is checked
STANDING = 1.0
"""A robot counts as moving while its command would carry it out of its tolerances within this time
[s]: it would leave its goal again while it brakes."""
Circles = Any  # rows x, y, radius [m], and what else the planner takes: an array or a list of lists


class Route:
    """Knows to which goal a robot drives.

    `goals`: poses (3,) [m, m, rad], at least one. `loop`: whether the first goal follows the last
    one, for ever. `clicked`: whether goals come while it drives: `goals` only say where maps begin,
    and it is idle.

    Examples
    --------
    >>> route = Route([(1.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
    >>> route.hold()
    >>> route.goal, route.leg, route.done
    ((0.0, 0.0, 0.0), (2, 2), False)
    """

    def __init__(self, goals: Sequence[Pose], loop: bool = False, clicked: bool = False) -> None:
        self.goals, self.loop, self.clicked = tuple(goals), loop, clicked
        self.idle = clicked  # whether no goal is given yet
        self.held = 0  # how many goals were held so far, all rounds counted

    def hold(self) -> None:
        """Note that the present goal is held: the next one becomes the goal."""
        self.held += 1

    def go(self, goal: Pose) -> None:
        """Take a goal instead of all others."""
        self.goals, self.loop, self.idle, self.held = (goal,), False, False, 0

    @property
    def rounds(self) -> int:
        """How often all goals were held."""
        return self.held // len(self.goals)

    @property
    def done(self) -> bool:
        """Whether the last goal is held; never of a loop."""
        return self.rounds > 0 and not self.loop

    @property
    def is_last(self) -> bool:
        """Whether the route ends with the present goal."""
        return not self.loop and self.held >= len(self.goals) - 1

    @property
    def leg(self) -> tuple[int, int]:
        """Number of the present goal, from 1, and of all goals."""
        count = len(self.goals)
        return (count if self.done else self.held % count + 1), count

    @property
    def goal(self) -> Pose:
        """The present goal; the last one when all are held."""
        return self.goals[self.leg[0] - 1]

    @property
    def words(self) -> str:
        """Which goal of how many, for people; empty for a single goal."""
        number, count = self.leg
        lap = f", round {self.rounds + 1}" if self.loop else ""
        return f"goal {number} of {count}{lap}" if count > 1 else ""

    def report(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        number, count = self.leg
        return {"goal": number, "of": count, "held": self.held}


@dataclass(frozen=True)
class Moment:
    """What a session knows at the time of a plan, beside the pose."""

    driving: bool = False  # whether commands pass the gate
    held: Speeds | None = None
    """Mean command on the wire since the last plan; None if it is not known."""
    scan: Any = None
    """What the lidar sees from the pose; None without one, or before its first turn."""
    began: float | None = None
    """When commands first passed the gate [s]; None: at the first plan that drives."""
    stamp: float = 0.0  # of the pose [s]: when the command will act


class Planned(NamedTuple):
    """What a planner answers."""

    v: float  # [m/s]
    omega: float  # [rad/s]
    status: str  # a word on how the plan came about
    reason: str = ""  # why it does not drive to the goal, in words; empty if it does
    vy: float = 0.0  # of an omni, to the left [m/s]


Step = Callable[[Pose, Circles, Moment], Planned]


@dataclass(frozen=True)
class Task:
    """The goal of a drive, its tolerances, and the obstacles."""

    goal: Pose
    tolerance: float  # [m]
    heading_tolerance: float  # [rad]
    radius: float  # of the robot [m]
    circles_at: Callable[[float], Circles]
    """Obstacles at a time since the beginning of the drive [s]."""
    gap_at: Callable[[Pose, float], float] | None = None
    """Distance of a robot at a pose [m, m, rad] and a time [s] to the nearest obstacle of any kind,
    between edges [m]; None: of the circles."""
    misplaced: Callable[[Pose], str] | None = None
    """Says why a robot cannot stand at the pose from which it would begin, in words; else empty."""
    route: Route | None = None  # goals one after the other; `goal` alone if not given


class Navigator:
    """A controller for the bridge that knows when it has arrived.

    Time counts from the moment in which the gate first lets commands pass.

    `step`: plans; see `Step`. `task`: goal and obstacles. `settle`: how long the robot must stand
    at the goal [s]. `seconds`: give up after so long [s]. `wait`: give up if no command has passed
    this long after the start [s]; `seconds` if not given. `clock`: [s].
    """

    def __init__(
        self,
        step: Step,
        task: Task,
        settle: float,
        seconds: float,
        clock: Callable[[], float] = time.monotonic,
        wait: float | None = None,
    ) -> None:
        self._step = step
        self._task = task
        self._settle = settle
        self._seconds = seconds
        self._clock = clock
        self.route = task.route or Route((task.goal,))  # which goal it drives to
        self._wish: Pose | None = None
        self.passed: deque[str] = deque(maxlen=SHOWN)
        """The last goals that were held before the last one, in words."""
        self.reason = ""
        """Why the last plan is none that drives to the goal, in words, where its planner says."""
        self.refused = ""  # why it was not driven from where it stood, in words; else empty
        self._wait = seconds if wait is None else wait
        self._started: float | None = None
        self._began: float | None = None
        self._inside: tuple[float, State] | None = None  # since when and where it stands there
        self._last: State | None = None
        self._wanted = STILL
        self.arrived_after: float | None = None
        """From the beginning until the goal was reached and then held [s]."""
        self.clearance = math.inf
        """Smallest distance between the edges of robot and obstacles so far [m], by the measured
        pose."""
        self.statuses: Counter[str] = Counter()

    def go(self, goal: Pose) -> None:
        """Drive to this goal from the next plan on; any thread may ask."""
        self._wish = goal

    def __call__(self, state: State, moment: Moment) -> VelocityCommand:
        """Plan from a pose."""
        now = self._clock()
        if (goal := self._wish) is not None:
            self._wish = self._inside = self.arrived_after = None
            self.route.go(goal)
        if self._began is None and (wrong := self._misplaced(state)):
            # only where the gate lets it begin: until then it may be carried, or its pose settle
            self.refused, self.reason = wrong if moment.driving else self.refused, wrong
            return VelocityCommand(0.0, 0.0, now)
        if self._began is None and moment.driving:
            self._began = now if moment.began is None else moment.began
        circles = self._task.circles_at(self.elapsed(now))
        if self._began is not None:
            self._judge(state, circles, now)
        planned = self._step((state.x, state.y, state.theta), circles, moment)
        self._wanted = planned.v, planned.omega, planned.vy
        self.reason = planned.reason
        if self._began is not None:
            self.statuses[planned.status] += 1
        return VelocityCommand(planned.v, planned.omega, self._clock(), planned.vy)

    def _misplaced(self, state: State) -> str:
        look = self._task.misplaced
        return self.refused or ("" if look is None else look((state.x, state.y, state.theta)))

    def elapsed(self, now: float) -> float:
        """Time since the beginning [s]."""
        return 0.0 if self._began is None else now - self._began

    def _duration(self) -> float:
        """Until the goal was reached, else until now [s]."""
        return self.elapsed(self._clock()) if self.arrived_after is None else self.arrived_after

    def finished(self) -> bool:
        """Whether the goal is held, or time is up; the time counts from the first call."""
        now = self._clock()
        if self._started is None:
            self._started = now
        if self._began is None:
            return now - self._started > self._wait
        done = self.arrived_after is not None and not self.route.clicked
        return done or now - self._began > self._seconds

    @property
    def drove(self) -> bool:
        """Whether a command has ever passed."""
        return self._began is not None

    @property
    def touched(self) -> bool:
        """Whether robot and obstacle have touched, by the measured pose."""
        return self.clearance <= 0.0

    @property
    def stays(self) -> bool:
        """Whether the last pose is still within the tolerance of the goal."""
        return self._is_there(*self.errors()) and not self.route.idle

    def _is_there(self, distance: float, turn: float) -> bool:
        return distance <= self._task.tolerance and turn <= self._task.heading_tolerance

    @property
    def _stands(self) -> bool:
        """Whether the last command leaves the robot within the tolerance of the goal."""
        (distance, turn), (v, omega, vy) = self.errors(), self._wanted
        return self._is_there(distance + math.hypot(v, vy) * STANDING, turn + abs(omega) * STANDING)

    @property
    def arrived(self) -> bool:
        """Whether the goal was held, and the robot has stayed there."""
        return self.arrived_after is not None and self.stays

    def look(self, state: State | None) -> None:
        """Check a pose without planning from it: the one at which the robot came to rest."""
        if state is not None and self._began is not None:
            now = self._clock()
            self._judge(state, self._task.circles_at(self.elapsed(now)), now)

    def errors(self) -> tuple[float, float]:
        """Distance to the goal [m] and heading error [rad] of the last pose; infinite without."""
        if self._last is None:
            return math.inf, math.inf
        return goal_errors(self._last, self.route.goal)

    def _judge(self, state: State, circles: Circles, now: float) -> None:
        before, self._last = self._last, state
        self.clearance = min(self.clearance, self._least_gap(before or state, state, circles, now))
        since, at = self._inside or (now, state)
        self._inside = (since, at) if self.stays and self._stands else None
        if self._inside and now - since >= self._settle and self.arrived_after is None:
            # an autopilot's estimate goes on for a while after the robot has stopped
            x, y, turn = 2 * state.x - at.x, 2 * state.y - at.y, 2 * state.theta - at.theta
            ahead, self._inside = replace(state, x=x, y=y, theta=turn), (now, state)
            if self._is_there(*goal_errors(ahead, self.route.goal)):
                self._hold(since)

    def _hold(self, since: float) -> None:
        """Note that the goal is held since then; go on to the next one, if there is one."""
        assert self._began is not None
        words, after = self.route.words, since - self._began
        self.route.hold()
        if self.route.done:
            self.arrived_after = after
            return
        self._inside = None
        self.passed.append(f"{words} held after {after:.1f} s, on to {self.route.words}")

    def _least_gap(self, before: State, state: State, circles: Circles, now: float) -> float:
        """Smallest distance to an obstacle between one pose and the next [m]."""
        least, time_now, task = math.inf, self.elapsed(now), self._task
        for part in range(1, PARTS + 1):
            share = part / PARTS
            x = before.x + share * (state.x - before.x)
            y = before.y + share * (state.y - before.y)
            if task.gap_at is not None:
                turned = math.remainder(state.theta - before.theta, math.tau)
                pose = x, y, before.theta + share * turned
                least = min(least, task.gap_at(pose, time_now))
                continue
            gaps = (math.hypot(x - cx, y - cy) - radius for cx, cy, radius, *_ in circles)
            least = min(least, min(gaps, default=math.inf) - task.radius)
        return least

    def report(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        several = len(self.route.goals) > 1
        return {
            "arrived": self.arrived,
            **({"route": self.route.report()} if several else {}),
            **figures(self._duration(), self.arrived_after, self.errors(), self.clearance),
            "statuses": dict(self.statuses),
        }


def goal_errors(state: State, goal: Pose) -> tuple[float, float]:
    """Distance of a pose to a goal [m], and its heading error [rad]."""
    x, y, theta = goal
    return math.hypot(state.x - x, state.y - y), abs(math.remainder(state.theta - theta, math.tau))


def figures(
    duration: float, arrived_after: float | None, errors: tuple[float, float], clearance: float
) -> dict[str, Any]:
    """Put together what a drive came to, for JSON; what is infinite is not known."""
    distance, turn = errors
    return {
        "touched": clearance <= 0.0,
        "duration_s": round(duration, 3),
        "arrived_after_s": None if arrived_after is None else round(arrived_after, 3),
        "position_error_m": None if math.isinf(distance) else round(distance, 4),
        "heading_error_rad": None if math.isinf(turn) else round(turn, 4),
        "clearance_m": None if math.isinf(clearance) else round(clearance, 4),
    }
