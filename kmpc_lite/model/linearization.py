"""A model near given states and commands: what it predicts, and how that changes."""

from __future__ import annotations

from typing import NamedTuple

from kmpc_lite.types import Array


class Linearization(NamedTuple):
    """First-order expansion of the model at n points.

    ``x+ = value + A dx + B du + sum_j B_past[j] dpast[j]``.
    """

    value: Array
    """Predicted states, (..., 3)."""
    A: Array
    """Derivative by the state, (..., 3, 3)."""
    B: Array
    """Derivative by the present command, (..., 3, 2)."""
    B_past: Array
    """Derivative by past commands, newest first, (..., L, 3, 2)."""
