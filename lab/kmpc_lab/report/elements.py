"""Elements of the page: escaped text, tables and pictures."""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable
from html import escape

from kmpc_lab.report.captions import CAPTIONS

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
