"""What all commands print alike, and which files they may write."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TextIO

from kmpc_lite.errors import DataError

COLOURS = {"red": "31", "green": "32", "yellow": "33"}


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
