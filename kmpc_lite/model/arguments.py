"""What callers pass to a model, as arrays whose shapes go together."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.types import INPUTS, STATES, Array


def broadcast(
    x: ArrayLike, u: ArrayLike, history: ArrayLike | None, length: int, inputs: int = INPUTS
) -> tuple[Array, Array, Array | None]:
    """Poses (..., 3), commands (..., m) and the `length` commands before them (..., length, m).

    Raises ValueError for wrong shapes.
    """
    states, commands = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
    if states.shape[-1:] != (STATES,) or commands.shape[-1:] != (inputs,):
        raise ValueError(
            f"expected states (..., {STATES}) and commands (..., {inputs}), "
            f"got {states.shape} and {commands.shape}"
        )
    past = None
    if history is not None and length:
        past = np.asarray(history, dtype=float)
        if past.shape[-2:] != (length, inputs):
            raise ValueError(f"history: expected shape (..., {length}, {inputs}), got {past.shape}")
    lead = states.shape[:-1]
    if lead != commands.shape[:-1] or (past is not None and lead != past.shape[:-2]):
        lead = np.broadcast_shapes(
            lead, commands.shape[:-1], () if past is None else past.shape[:-2]
        )
        states, commands = _spread(states, lead, 1), _spread(commands, lead, 1)
        past = None if past is None else _spread(past, lead, 2)
    return states, commands, past


def _spread(values: Array, lead: tuple[int, ...], own: int) -> Array:
    """The same values for all of a leading shape; copied, which takes a fifth of a view's time."""
    shape = lead + values.shape[-own:]
    if values.shape == shape:
        return values
    out = np.empty(shape)
    out[...] = values
    return out


def windows(commands: Array, length: int) -> Array:
    """The `length` commands before each one, oldest first, (..., T, length, m)."""
    if not length:
        return np.empty((*commands.shape[:-1], 0, commands.shape[-1]))
    # a fifth of the time of a view
    places = np.arange(commands.shape[-2] - length)[:, None] + np.arange(length)
    return commands.take(places, axis=-2)


def speeds(commands: Array) -> Array:
    """Speed in any direction, and turn rate, (..., 2) of commands (..., m): what errors grow with.

    Commands of two numbers are given back as they are.
    """
    if commands.shape[-1] == INPUTS:
        return commands
    return np.stack([np.hypot(commands[..., 0], commands[..., 1]), commands[..., -1]], axis=-1)
