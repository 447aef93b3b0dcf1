"""Numbers of a command line that are checked while it is parsed."""

from __future__ import annotations

from argparse import ArgumentTypeError

LARGEST = 1e9
"""Beyond it a number is a slip of the pen."""


def positive(text: str) -> float:
    """Read a number > 0."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < LARGEST:
        raise ArgumentTypeError(f"expected a number > 0, got {text}")
    return value


def number(text: str) -> float:
    """Read a finite number."""
    try:
        value = float(text)
    except ValueError:
        value = LARGEST
    if not -LARGEST < value < LARGEST:
        raise ArgumentTypeError(f"expected a number, got {text}")
    return value


def count(text: str) -> int:
    """Read a whole number >= 1."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if not 1 <= value < LARGEST:
        raise ArgumentTypeError(f"expected a whole number >= 1, got {text}")
    return value
