"""What all commands print alike: colours where they are wanted, and the user's command line."""

from __future__ import annotations

import os
import sys
from typing import TextIO

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
