"""The demo's map for a log of one's own: as large as its robot needs it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

import kmpc_lite as kl
from kmpc_lite.control.margins import Margins
from kmpc_lite.learn.coverage import find_coverage
from kmpc_lite.scale import UNIT_SPEED
from kmpc_lite.scenario.files import Scenario, learned_wheels

UNIT_PERIOD = 0.1
"""Period [s] that suits the bundled map at `UNIT_SPEED`; a longer one needs a larger map."""
UNIT_TURNING_RADIUS = 0.5  # turning radius [m] of a car that the bundled map suits
UNIT_ASIDE = 0.06  # distance [m] that the bundled map's gaps leave to what is passed
DRIVES, TIGHTEST = 0.2, 0.05
"""Commands of more than this share of the fastest speed show the turning radius of a car, of which
this share may be tighter."""
PATIENCE, LEAST_PATIENCE = 8.0, 20.0
"""Time limit: a multiple of the ideal time, and so much more [s, of the bundled map]."""


def course_for(
    model: kl.KoopmanModel, data: kl.Dataset, scenario: Scenario
) -> tuple[Scenario, str]:
    """Enlarge a scenario for the robot that a model was learned from; and say how.

    The map grows in proportion to the largest speed of the log; more for a long period, a wide
    turning circle or wide margins. The time limit follows from the ideal time: the straight line at
    full speed, and the turns at both ends.

    `data`: the log that it was learned from. `scenario`: map of circles for a robot of 0.15 m and
    0.6 m/s. Raises ProblemError for a log that never turns, or never drives forward.
    """
    driven, known = model.info["driven"], learned_wheels(model.info)
    wheels = known or _guessed_wheels(data, driven["reverse"] > 0.0)
    fastest, turn = driven["forward"], driven["turn"]
    if not (fastest > 0.0 and turn > 0.0):
        missing = "drives forward" if fastest <= 0.0 else "turns"
        raise kl.ProblemError(f"the log never {missing}: the demo drives past obstacles")
    by = fastest / UNIT_SPEED * max(1.0, model.dt / UNIT_PERIOD)
    if isinstance(wheels, kl.Car):
        by = max(by, wheels.turning_radius / UNIT_TURNING_RADIUS)
    body = kl.NavigationProblem(
        dt=model.dt, u_max=(fastest, turn), robot_radius=by * scenario.radius
    )
    _, aside = Margins(model, body).straight(fastest)
    by = max(by, aside / UNIT_ASIDE)
    ideal = by * math.dist(scenario.start[:2], scenario.goal[:2]) / fastest + math.pi / turn
    timeout = PATIENCE * ideal + LEAST_PATIENCE * by * UNIT_SPEED / fastest
    text = (
        f"map and time limit are adapted: a robot of {by * scenario.radius:.2g} m radius, up to "
        f"{fastest:.2g} m/s; {timeout:.0f} s"
    )
    if isinstance(wheels, kl.Car) and not known:
        text += (
            "\nthe log never turns on the spot: driven as a car with a turning radius of "
            f"{wheels.turning_radius:.2g} m"
        )
    return replace(enlarged(scenario, by, timeout), wheels=wheels), text


def _guessed_wheels(data: kl.Dataset, reverses: bool) -> kl.Car | None:
    """A car if a log of speeds and turn rates never turns on the spot."""
    inputs = [episode.inputs for episode in data.episodes]
    spot = next(p for p in find_coverage(inputs, data.dt).parts if p.name == "on the spot")
    v, omega = np.abs(np.concatenate(inputs))[:, [0, -1]].T
    used = (v > DRIVES * v.max()) & (omega > 0.0)
    if spot.share > 0.1 or not used.any():
        return None
    return kl.Car(float(np.quantile(v[used] / omega[used], TIGHTEST)), reverse=reverses)


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
