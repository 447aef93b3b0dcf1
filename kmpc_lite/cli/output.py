"""What all commands print alike, which files they may write, and how far long work has come."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import TextIO

from kmpc_lite.errors import DataError

COLOURS = {"red": "31", "green": "32", "yellow": "33"}
WIDTH = 30
"""Of the bar [characters]."""


def paint(text: str, colour: str, stream: TextIO) -> str:
    """Colour a text where `stream` is a terminal that shows colours and NO_COLOR is not set."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb" or not stream.isatty()
    return text if plain else f"\x1b[{COLOURS[colour]}m{text}\x1b[0m"


def clear_line(stream: TextIO) -> None:
    """Wipe a progress bar that was left unfinished, on a terminal."""
    if stream.isatty():
        stream.write("\r\x1b[2K")


def command_line() -> str:
    """What the user typed, for reports."""
    return "kmpc " + " ".join(sys.argv[1:])


def keep_inputs(output: Path | None, *inputs: Path | None) -> None:
    """Refuse to write over a file that is read, or into a folder that cannot be written to.

    A command calls it before its work: learning may take minutes.
    """
    if output is not None:
        folder = output.parent
        if not folder.is_dir():
            raise DataError(f"{output}: cannot be written: there is no folder {folder}")
        if output.is_dir() or not os.access(folder, os.W_OK):
            reason = "it is a folder" if output.is_dir() else f"{folder} is write-protected"
            raise DataError(f"{output}: cannot be written: {reason}")
    for file in inputs:
        if output is not None and file is not None and output.resolve() == file.resolve():
            raise DataError(
                f"{output}: would be written over, but is read too; "
                "choose another name for what is written"
            )


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
