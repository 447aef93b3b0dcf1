"""Numbers and outcomes in words, the same in pictures and page."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable
from html import escape

import numpy as np

from kmpc_lab.sim.closed_loop import Outcome, Run
from kmpc_lite.control.plan import PlanStatus
from kmpc_lite.errors import KmpcError
from kmpc_lite.scenario.world import obstacle_gaps
from kmpc_lite.types import Array

STATUS_WORDS = {
    PlanStatus.SOLVED.name: "solved",
    PlanStatus.FEASIBLE.name: "solver stopped early, plan verified",
    PlanStatus.FALLBACK.name: "rest of the last good plan",
    PlanStatus.STOPPED.name: "no usable plan, braking",
}
ALT = "Map of the drive: obstacles, the robot's path, start and goal; below it commands over time"
CAPTION = (
    "To scale. Below, what was sent to the motors, one step per period; shaded: steps whose plan "
    "was not simply solved. Clearance is from edge to edge."
)
UNIT = re.compile(r"(?<=\d) (?=(?:mm|ms|mrad|m|s|rad|m/s|rad/s|%)(?![\w]))")


def length(metres: float) -> str:
    """Length in mm below a metre, else in m.

    >>> length(0.0519), length(-0.004), length(2.0768)
    ('52 mm', '-4 mm', '2.08 m')
    """
    return (
        f"{1e3 * metres:.{0 if abs(metres) >= 0.01 else 1}f} mm".replace(".0 ", " ")
        if abs(metres) < 1.0
        else f"{metres:.2f} m"
    )


def milliseconds(seconds: float) -> str:
    """Time of a step with three digits.

    >>> milliseconds(0.00067634), milliseconds(0.0135922), milliseconds(0.1)
    ('0.676 ms', '13.6 ms', '100 ms')
    """
    value = 1e3 * seconds
    return f"{value:.{0 if value >= 100 else 1 if value >= 10 else 2 if value >= 1 else 3}f} ms"


def angle(radians: float) -> str:
    """Angle in rad and degrees.

    >>> angle(0.1351)
    '0.135 rad (7.7°)'
    """
    return f"{radians:.3f} rad ({np.degrees(radians):.1f}°)"


def outcome_title(run: Run) -> str:
    """Outcome and time in a few words."""
    if run.outcome is Outcome.REACHED:
        return f"Goal reached in {run.duration:.4g} s"
    if run.outcome is Outcome.COLLISION:
        return f"Collision after {run.duration:.4g} s"
    return f"Goal not reached within {run.duration:.4g} s"


def clearance_words(run: Run) -> str:
    """Smallest distance to an obstacle, in a few words."""
    if not np.isfinite(run.clearance):
        return "no obstacles"
    if run.clearance < 0.0:
        return f"{length(-run.clearance)} deep into an obstacle"
    return f"{length(run.clearance)} clear of obstacles"


def outcome_sentence(run: Run) -> str:
    """Outcome in one sentence, for a reader that has not seen a run before."""
    scenario = run.scenario
    if run.outcome is Outcome.COLLISION:
        where = f"{length(run.position_error)} from the goal"
        return (
            f"The robot touched an obstacle {run.duration:.4g} s after its start, {where}, "
            f"and went {length(-run.clearance)} into it."
        )
    count = scenario.obstacle_count
    past = f" It kept at least {length(run.clearance)} from {_obstacles(count)}." if count else ""
    short = f"{length(run.position_error)} and {angle(run.heading_error)}"
    if run.outcome is Outcome.REACHED:
        return (
            f"The robot reached its goal in {run.duration:.4g} s and stands {short} from it.{past}"
        )
    ended = f" How it ended: {run.info['ended']}." if run.info.get("ended") else ""
    return (
        f"The robot did not reach its goal within {run.duration:.4g} s: "
        f"it is still {short} from it.{past}{ended}"
    )


def _obstacles(count: int) -> str:
    return "the obstacle" if count == 1 else f"all {count} obstacles"


def substeps(run: Run) -> int:
    """Sub-samples per period in `Run.path`.

    Raises KmpcError for a run without a single step, whose arrays do not fit together, or that ran
    away to infinity.
    """
    steps = len(run.inputs)
    if steps == 0 or (len(run.path) - 1) % steps or len(run.path) <= steps:
        raise KmpcError(
            "run: expected at least one step and whole sub-samples, "
            f"got {steps} steps and a path of {len(run.path)} poses"
        )
    if not (np.isfinite(run.path).all() and np.isfinite(run.inputs).all()):
        raise KmpcError(
            "run: the path or the commands hold NaN or infinity; "
            "there is nothing that could be drawn to scale"
        )
    return (len(run.path) - 1) // steps


def path_times(run: Run) -> Array:
    """Times (T S + 1,) of the poses in `Run.path` [s]."""
    times: Array = np.arange(len(run.path)) * (run.dt / substeps(run))
    return times


def path_clearances(run: Run) -> Array:
    """Clearance (T S + 1,) between robot and nearest obstacle along the path [m].

    It is infinite without obstacles.
    """
    return obstacle_gaps(run.scenario, run.path, path_times(run))


def image(svg: bytes) -> str:
    """The picture as an element."""
    source = f"data:image/svg+xml;base64,{b64encode(svg).decode('ascii')}"
    below = f"<figcaption>{escape(CAPTION)}</figcaption>"
    return f'<figure class="map"><img alt="{escape(ALT)}" src="{source}">{below}</figure>'


def joined(words: str) -> str:
    """Keep a number and its unit on one line."""
    return UNIT.sub("\u00a0", words)


def text(words: str) -> str:
    """Escape, and keep a number and its unit on one line."""
    return escape(joined(words))


def table(rows: Iterable[tuple[str, str]]) -> str:
    """Rows of a name and a value; both are text, not HTML."""
    body = "\n".join(
        f'<tr><th scope="row">{text(name)}</th><td>{text(value)}</td></tr>' for name, value in rows
    )
    return f'<div class="scroll"><table>\n{body}\n</table></div>'
