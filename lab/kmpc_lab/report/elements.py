"""Elements of the page: escaped text, tables, and the picture with its caption."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable
from html import escape

ALT = "Map of the drive: obstacles, the robot's path, start and goal; below it commands over time"
CAPTION = (
    "To scale. Below, what was sent to the motors, one step per period; shaded: steps whose plan "
    "was not simply solved. Clearance is from edge to edge."
)
UNIT = re.compile(r"(?<=\d) (?=(?:mm|ms|mrad|m|s|rad|m/s|rad/s|%)(?![\w]))")


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
