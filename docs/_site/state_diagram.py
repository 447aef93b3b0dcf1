"""The safety gate's state diagram as SVG, drawn from its Mermaid source: no network, no browser."""

from __future__ import annotations

import math
import re
from itertools import groupby

PLACES = {
    "ESTOP": (0, 0),
    "IDLE": (0, 1),
    "WAITING": (1, 1),
    "ACTIVE": (2, 1),
    "STOPPING": (3, 1),
    "YIELDED": (3, 0),
    "RELEASED": (1, 2),
    "HOLDING": (2, 2),
}
"""Column and row of each state."""
LEFT, TOP, ACROSS, DOWN = 80, 50, 260, 145
"""Centre of the first state, and the distances between columns and rows [px]."""
WIDTH, HEIGHT = 116, 40
ASIDE = 9.0
"""How far two arrows between the same states are moved apart [px]."""
LABEL_SHARE, LABEL_SHARE_BOTH = 0.3, 0.33
"""Where on its arrow a label stands, from the tail: off the middle, where arrows cross."""


def draw(source: str) -> str:
    """Give the SVG of a Mermaid state diagram whose states all have a place.

    Raises
    ------
    KeyError
        For a state without a place.
    """
    edges = re.findall(r"^\s*(\w+) --> (\w+): (\w+)$", source, re.MULTILINE)
    parts = []
    for (start, end), same in groupby(sorted(edges), key=lambda edge: edge[:2]):
        both = any(edge[:2] == (end, start) for edge in edges)
        parts.append(arrow(start, end, ", ".join(event for _, _, event in same), both))
    parts += [state(name) for name in sorted({name for edge in edges for name in edge[:2]})]
    for note in re.findall(r"note right of (\w+): (.*)$", source, re.MULTILINE):
        x, y = centre(note[0])
        parts.append(f'<text x="{x + WIDTH / 2 + 10}" y="{y + 5}" font-size="12">{note[1]}</text>')
    body = "\n".join(parts)
    size = f"{2 * LEFT + 3 * ACROSS} {2 * TOP + 2 * DOWN}"
    # without blank lines, which would end the HTML block in a page
    return f"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}" role="img" \
aria-label="State diagram of the safety gate" font-family="sans-serif" style="background:#fff">
<defs><marker id="tip" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="7" markerHeight="7" \
orient="auto"><path d="M0 0L10 5L0 10z" fill="#333"/></marker></defs>
{body}
</svg>"""


def centre(name: str) -> tuple[float, float]:
    """Centre of a state [px]."""
    column, row = PLACES[name]
    return LEFT + ACROSS * column, TOP + DOWN * row


def state(name: str) -> str:
    """Box of a state."""
    x, y = centre(name)
    return (
        f'<rect x="{x - WIDTH / 2}" y="{y - HEIGHT / 2}" width="{WIDTH}" height="{HEIGHT}" rx="8" '
        f'fill="#dcebf7" stroke="#333"/><text x="{x}" y="{y + 5}" text-anchor="middle" '
        f'font-size="14" font-weight="bold" fill="#222">{name}</text>'
    )


def arrow(start: str, end: str, label: str, both: bool) -> str:
    """Arrow between the edges of two states, moved aside where another one comes back."""
    (x1, y1), (x2, y2) = centre(start), centre(end)
    dx, dy = x2 - x1, y2 - y1
    length = math.hypot(dx, dy)
    # from the centre to the edge of a box in this direction
    cut = min(WIDTH / 2 / abs(dx) if dx else math.inf, HEIGHT / 2 / abs(dy) if dy else math.inf)
    aside_x, aside_y = (-ASIDE * dy / length, ASIDE * dx / length) if both else (0.0, 0.0)
    x1, y1, x2, y2 = (
        x1 + cut * dx + aside_x,
        y1 + cut * dy + aside_y,
        x2 - cut * dx + aside_x,
        y2 - cut * dy + aside_y,
    )
    share = LABEL_SHARE_BOTH if both else LABEL_SHARE
    x, y = x1 + share * (x2 - x1), y1 + share * (y2 - y1)
    if dy == 0:
        y += 14.0 if both and dx > 0 else -7.0
    text = f'<text x="{x:.1f}" y="{y + 4:.1f}" text-anchor="middle" font-size="11.5"'
    return (
        f'<path d="M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}" stroke="#333" stroke-width="1.4" '
        'fill="none" marker-end="url(#tip)"/>'
        f'{text} stroke="#fff" stroke-width="4">{label}</text>{text} fill="#333">{label}</text>'
    )
