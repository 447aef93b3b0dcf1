"""A progress bar on standard error: on a terminal only, and honest about the time that is left."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

PERIOD = 0.5
"""Between pictures of `watching` [s]."""
WIDTH = 30
"""Of the bar [characters]."""


class ProgressBar:
    """Bar with an estimate of the time left, once there is something to estimate it from.

    `label`: what is under way. `quiet`: draw nothing, even on a terminal.
    """

    def __init__(self, label: str, quiet: bool = False) -> None:
        self.label = label
        self.shown = sys.stderr.isatty() and not quiet
        self._first: tuple[float, int] | None = None
        """When the bar was first drawn [s], and how much was done then: by an earlier run."""

    def __call__(self, done: int, total: int) -> None:
        """Draw `done` of `total`."""
        if not self.shown:
            return
        now = time.monotonic()
        if self._first is None:
            self._first = now, done
        begin, before = self._first
        left = (now - begin) / (done - before) * (total - done) if done > before else None
        told = "" if done == total else f"  {remaining(left)}"
        filled = WIDTH * done // max(total, 1)
        print(
            f"\r\x1b[2K{self.label} [{'#' * filled}{'.' * (WIDTH - filled)}] {done}/{total}{told}",
            end="\n" if done == total else "",
            file=sys.stderr,
            flush=True,
        )


def remaining(seconds: float | None) -> str:
    """Put an estimate [s] into words; None if there is none yet."""
    if seconds is None:
        return "time left not known yet"
    if seconds < 60.0:
        return f"about {max(1.0, seconds):.0f} s left"
    minutes = round(seconds / 60.0)
    if minutes < 60:
        return f"about {minutes} min left"
    return f"about {minutes // 60} h {minutes % 60:02d} min left"


@contextmanager
def watching(line: Callable[[], str], quiet: bool = False) -> Iterator[None]:
    """Show a line while something runs that calls nobody: a robot that is driven in real time.

    `line`: gives the text; called in a thread of its own. `quiet`: show nothing, even on a
    terminal.
    """
    if quiet or not sys.stderr.isatty():
        yield
        return
    done = threading.Event()

    def draw() -> None:
        while not done.wait(PERIOD):
            print(f"\r\x1b[2K{line()}", end="", file=sys.stderr, flush=True)

    thread = threading.Thread(target=draw, name="kmpc-progress", daemon=True)
    thread.start()
    try:
        yield
    finally:
        done.set()
        thread.join(1.0)  # a terminal that blocks is left to itself
        print("\r\x1b[2K", end="", file=sys.stderr, flush=True)
