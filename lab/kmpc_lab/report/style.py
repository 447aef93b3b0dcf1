"""How pictures look and become bytes: the same ones everywhere, whatever matplotlibrc says."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from kmpc_lite.errors import KmpcError
from kmpc_lite.files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito's set, which colour-blind readers can tell apart; wherever two of them meet, line
# style, marker or hatch differ too
INK, GREY, BLUE, ORANGE, RED, GREEN, PURPLE = (
    "#222222",
    "#8a8a8a",
    "#0072b2",
    "#e69f00",
    "#d55e00",
    "#009e73",
    "#cc79a7",
)
LINES = (
    (BLUE, "-", "o"),
    (RED, "--", "s"),
    (GREEN, "-.", "^"),
    (PURPLE, ":", "D"),
    (ORANGE, (0, (7, 2)), "v"),
    (INK, (0, (3, 1, 1, 1, 1, 1)), "P"),
)
"""Colour, line style and marker of one series after the other."""
WIDTH = 5.4
"""Of a picture [in]; at this width 10 pt letters are still legible where a phone shows it."""
SMALL = 8.5
_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.labelsize": 9.5,
    "axes.edgecolor": "#555555",
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.7,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "text.color": INK,
    "legend.fontsize": SMALL,
    "legend.frameon": False,
    "hatch.linewidth": 0.6,
    "figure.facecolor": "white",
    "svg.hashsalt": "kmpc_lite",
    "text.parse_math": False,
}


@contextmanager
def style() -> Iterator[None]:
    """Draw in the project's style inside the block.

    Raises KmpcError if matplotlib is not installed.
    """
    try:
        import matplotlib
    except ImportError as error:
        raise KmpcError("pictures need matplotlib: pip install 'kmpc-lab[plot]'") from error
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_STYLE)
        yield


def new_figure(height: float) -> Figure:
    """Make an empty figure that lays itself out; to be called inside `style`.

    It is `WIDTH` by `height` [in], the legend not counted.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure = Figure(figsize=(WIDTH, height), layout=ConstrainedLayoutEngine(h_pad=0.06, w_pad=0.06))
    FigureCanvasAgg(figure)
    return figure


def legend_below(figure: Figure, handles: list[Any], columns: int = 3) -> None:
    """Put a legend under everything, where it can cover no data; the figure grows by its height."""
    if handles:
        rows = -(-len(handles) // columns)
        figure.set_figheight(figure.get_figheight() + 0.12 + 0.18 * rows)
        figure.legend(
            handles=handles,
            loc="outside lower center",
            ncols=min(columns, len(handles)),
            columnspacing=1.4,
            handlelength=2.2,
        )


def render(figure: Figure, kind: Literal["svg", "png"], dpi: int = 150) -> bytes:
    """Picture as a file's bytes, without a date in them."""
    buffer = BytesIO()
    metadata = dict.fromkeys(
        ("Creator", "Date", "Format", "Type") if kind == "svg" else ("Software",)
    )
    with style():
        figure.savefig(buffer, format=kind, dpi=dpi, metadata=metadata)
    return buffer.getvalue()


def write_picture(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all.

    Raises KmpcError if it cannot be written.
    """
    try:
        with write_whole(path) as file:
            file.write(content)
    except OSError as error:
        raise KmpcError(f"{path}: cannot write: {error.strerror or error}") from error


def plain_log_ticks(axis: Any) -> None:
    """Ticks at 1, 2, 5 in plain numbers, not as powers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    wide = high / low > 1e2
    axis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0), numticks=9))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())
