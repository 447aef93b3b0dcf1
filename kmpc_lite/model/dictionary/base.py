"""Dictionaries: how a pose is lifted, and which commands enter the bilinear model.

A dictionary gives the lifted state ``z = phi(x)`` (paper, eq. 3) and its Jacobian, both batched
over any leading axes. It also says which inputs ``w`` the model is bilinear in: the command itself
for most, delayed and past commands for `InputHistoryDictionary`.
"""

from __future__ import annotations

from typing import Any, ClassVar, Protocol

import numpy as np

from kmpc_lite.errors import ModelError
from kmpc_lite.types import INPUTS, Array

MAX_SIZE = 10_000
"""Lifted coordinates of the largest dictionary: a Gram matrix of them still fits a big machine's
memory."""
MAX_LAG = 1000  # longest input history [periods]


class Dictionary(Protocol):
    """Lifting functions of a Koopman model; subclass it to write your own.

    Only `names`, `lift` and `jacobian` must be given: the defaults of the others say that the model
    is bilinear in the present command. `kind` and `config` are needed to save a model to a file.
    """

    kind: ClassVar[str] = "custom"

    @property
    def names(self) -> tuple[str, ...]:
        """One name for each lifted coordinate; ``"1"`` stands for the constant."""

    def lift(self, x: Array) -> Array:
        """Lift states (..., 3) to (..., nz)."""

    def jacobian(self, x: Array) -> Array:
        """Differentiate `lift` at states (..., 3): (..., nz, 3)."""

    def expand(self, x: Array) -> Array:
        """Give `lift` and `jacobian` side by side in one array (..., nz, 1 + 3)."""
        return np.concatenate([self.lift(x)[..., None], self.jacobian(x)], axis=-1)

    @property
    def size(self) -> int:
        """Number of lifted coordinates, nz."""
        return len(self.names)

    @property
    def history(self) -> int:
        """How many past commands the model needs, L."""
        return 0

    @property
    def commands(self) -> int:
        """Numbers of a command, m: 3 of a robot that drives sideways, too."""
        return INPUTS

    @property
    def input_size(self) -> int:
        """Number of inputs the model is bilinear in, nw."""
        return self.commands

    def inputs(self, u: Array, history: Array | None = None) -> Array:
        """Give the bilinear inputs (..., nw) of commands (..., 2) and past ones (..., L, 2).

        `history` is in order of time: its last row is the command before `u`.
        """
        return u

    def inputs_jacobian(self, u: Array, history: Array | None = None) -> Array | None:
        """Differentiate `inputs`: (..., nw, 1 + L, 2), by present and past commands, newest first.

        None stands for the identity.
        """
        return None

    def config(self) -> dict[str, Any]:
        """Give the constructor arguments, as values that JSON can hold."""
        return {}


class AnyWheels(Dictionary):
    """A dictionary for robots whose commands are two numbers, or three."""

    _commands = INPUTS

    def __init__(self, commands: int = INPUTS) -> None:
        if commands not in (INPUTS, INPUTS + 1):
            who = type(self).__name__
            raise ModelError(f"{who}: commands: expected 2 or 3, got {commands!r}")
        self._commands = int(commands)

    @property
    def commands(self) -> int:
        """Numbers of a command."""
        return self._commands

    def config(self) -> dict[str, Any]:
        """Give the constructor's arguments, if they are not the usual ones."""
        return {} if self._commands == INPUTS else {"commands": self._commands}


class LiftedAsBase(Dictionary):
    """A dictionary that lifts poses as its base does, and differs from it in its inputs."""

    base: Dictionary

    @property
    def commands(self) -> int:
        """As the base."""
        return self.base.commands

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the base's coordinates."""
        return self.base.names

    @property
    def size(self) -> int:
        """As the base."""
        return self.base.size

    def lift(self, x: Array) -> Array:
        """As the base."""
        return self.base.lift(x)

    def jacobian(self, x: Array) -> Array:
        """As the base."""
        return self.base.jacobian(x)

    def expand(self, x: Array) -> Array:
        """As the base."""
        return self.base.expand(x)


def dictionary_to_config(dictionary: Dictionary) -> dict[str, Any]:
    """Describe a dictionary as values that JSON can hold."""
    return {"kind": dictionary.kind, **dictionary.config()}
