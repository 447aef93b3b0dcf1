"""Elements of the page: escaped text, tables, and pictures with their captions."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable
from html import escape

CAPTIONS = {
    "map": (
        "Map of the drive: obstacles, the robot's path and plans, start and goal",
        "To scale. Circles are the robot at the times beside them, "
        "the line in each points forward. Dashed lines are what the controller "
        "planned at some of those times, each up to its dot.",
    ),
    "commands": (
        "Commanded forward speed and turn rate over time",
        "What was sent to the motors, one step per period. Shaded: "
        "steps whose plan was not simply solved.",
    ),
    "errors": (
        "Distance to the goal, heading error and clearance over time",
        "Both errors must be within the dashed lines for the robot to have arrived. "
        "Clearance is from edge to edge.",
    ),
    "timing": (
        "Time of each control step and its distribution, against the period",
        "Time from pose to command. The first step starts without an earlier plan.",
    ),
    "fit": (
        "Held-out prediction errors of the model and of the nominal unicycle",
        "Smaller is better. The nominal unicycle is the robot that obeys its commands exactly.",
    ),
}
"""Alternative text and caption of each picture."""
MOVING_CAPTION = (
    " Moving obstacles are filled where they start and dotted where they are at the times in them."
)
UNIT = re.compile(r"(?<=\d) (?=(?:mm|ms|mrad|m|s|rad|m/s|rad/s|%)(?![\w]))")


def image(name: str, svg: bytes, more: str) -> str:
    """Picture as an element; inside an image its ids cannot meet those of the others."""
    alt, caption = CAPTIONS[name]
    picture = (
        f'<img alt="{escape(alt)}" '
        f'src="data:image/svg+xml;base64,{b64encode(svg).decode("ascii")}">'
    )
    below = f"<figcaption>{escape(caption + more)}</figcaption>"
    return f'<figure class="{name}">{picture}{below}</figure>'


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
