"""The demo's course for a log of one's own: map, speeds and time limit as its robot needs them."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

import kmpc_lite as kl
from kmpc_lite.control.margins import Margins
from kmpc_lite.learn.coverage import find_coverage
from kmpc_lite.scale import UNIT_SPEED
from kmpc_lite.scenario.files import Scenario

if TYPE_CHECKING:
    from kmpc_lite.learn.learning import Learned

UNIT_PERIOD = 0.1
"""Period [s] that suits the bundled map at `UNIT_SPEED`; a longer one needs a larger map."""
UNIT_TURNING_RADIUS = 0.5
"""Turning radius [m] of a car that the bundled map suits."""
UNIT_ASIDE = 0.06
"""Distance [m] that the bundled map's gaps leave to what is passed."""
REVERSES = 0.1
"""A log whose fastest reversing is a smaller share of its fastest speed shows none."""
DRIVES = 0.2
"""Commands of more than this share of the fastest speed show the turning radius of a car ..."""
TIGHTEST = 0.05
"""... of which this share may be tighter."""
PATIENCE, LEAST_PATIENCE = 8.0, 20.0
"""Time limit: a multiple of the ideal time, and so much more [s, of the bundled map]."""


@dataclass(frozen=True)
class OwnCourse:
    """What the robot of a log drives in the demo."""

    scenario: Scenario
    problem: kl.NavigationProblem
    """Period, speeds and wheels."""
    text: str
    """What was adapted, in lines."""


def course_for(learned: Learned, data: kl.Dataset, scenario: Scenario) -> OwnCourse:
    """Adapt a scenario to the robot of a log.

    Speeds are the largest of the log. The map grows in proportion to the speed; more for a long
    period, a wide turning circle or wide margins. The time limit follows from the ideal time: the
    straight line at full speed, and the turns at both ends.

    `learned`: model, and what its log shows. `data`: the log. `scenario`: map of circles for a
    robot of 0.15 m and 0.6 m/s. Raises ProblemError for a log that never turns, or never drives
    forward.
    """
    driven = learned.made["driven"]
    fastest, turn = driven["forward"], driven["turn"]
    if not (fastest > 0.0 and turn > 0.0):
        missing = "drives forward" if fastest <= 0.0 else "turns"
        raise kl.ProblemError(f"the log never {missing}: the demo drives past obstacles")
    back = driven["reverse"] if driven["reverse"] > REVERSES * fastest else 0.0
    wheels = _wheels(data, back > 0.0)
    problem = kl.NavigationProblem(
        dt=data.dt, u_min=(-back, -turn), u_max=(fastest, turn), wheels=wheels
    )
    by = _enlargement(learned, problem, scenario)
    ideal = by * math.dist(scenario.start[:2], scenario.goal[:2]) / fastest + math.pi / turn
    timeout = PATIENCE * ideal + LEAST_PATIENCE * by * UNIT_SPEED / fastest
    text = (
        f"map and time limit are adapted: a robot of {by * scenario.radius:.2g} m radius, up to "
        f"{fastest:.2g} m/s ahead, {back:.2g} m/s back and {turn:.2g} rad/s; {timeout:.0f} s"
    )
    if isinstance(wheels, kl.Car):
        text += (
            "\nthe log never turns on the spot: driven as a car with a turning radius of "
            f"{wheels.turning_radius:.2g} m"
        )
    return OwnCourse(enlarged(scenario, by, timeout), problem, text)


def _wheels(data: kl.Dataset, reverses: bool) -> kl.Differential | kl.Car:
    """A car if the log never turns on the spot; else wheels on either side."""
    inputs = [episode.inputs for episode in data.episodes]
    spot = next(p for p in find_coverage(inputs, data.dt).parts if p.name == "on the spot")
    if spot.share <= 0.1:
        v, omega = np.abs(np.concatenate(inputs)).T
        used = (v > DRIVES * v.max()) & (omega > 0.0)
        if used.any():
            radius = float(np.quantile(v[used] / omega[used], TIGHTEST))
            return kl.Car(radius, reverse=reverses)
    return kl.Differential()


def _enlargement(learned: Learned, problem: kl.NavigationProblem, scenario: Scenario) -> float:
    """How much larger the map has to be."""
    fastest = float(problem.u_max[0])
    by = fastest / UNIT_SPEED * max(1.0, problem.dt / UNIT_PERIOD)
    if isinstance(problem.wheels, kl.Car):
        by = max(by, problem.wheels.turning_radius / UNIT_TURNING_RADIUS)
    body = replace(problem, robot_radius=by * scenario.radius)
    _, aside = Margins(learned.model, body).straight(fastest)
    return max(by, aside / UNIT_ASIDE)


def enlarged(scenario: Scenario, by: float, timeout: float) -> Scenario:
    """Give a scenario of circles with all its lengths times a factor, and a time limit [s]."""
    x_min, y_min, x_max, y_max = scenario.bounds
    (x, y, heading), (goal_x, goal_y, goal_heading) = scenario.start, scenario.goal
    return replace(
        scenario,
        bounds=(by * x_min, by * y_min, by * x_max, by * y_max),
        circles=tuple(kl.Circle(*(by * value for value in c)) for c in scenario.circles),
        radius=by * scenario.radius,
        start=(by * x, by * y, heading),
        goal=(by * goal_x, by * goal_y, goal_heading),
        tolerance=by * scenario.tolerance,
        margin=by * scenario.margin,
        timeout=timeout,
    )
