"""What a controller asks of a model, and a model in the robot's own units.

A dictionary cannot be rewritten for other units (Hermite polynomials are not homogeneous), so the
model is asked in its own units, and what it answers is converted.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.model.bilinear import Linearization
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.noise_model import NoiseModel, NoiseSources
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array


class MotionModel(Protocol):
    """Predicts a robot's poses from its commands; `KoopmanModel` and `ScaledModel` do."""

    @property
    def dt(self) -> float:
        """Period."""

    @property
    def inputs(self) -> int:
        """Numbers of a command, m."""

    @property
    def history(self) -> int:
        """How many past commands it needs, L."""

    @property
    def noise_model(self) -> NoiseModel | None:
        """Covariance of what it cannot explain."""

    @property
    def info(self) -> Mapping[str, Any]:
        """What its fit remembered."""

    def predict(self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None = None) -> Array:
        """Poses (..., 3) one period ahead of poses (..., 3) under commands (..., 2)."""

    def rollout(self, x0: ArrayLike, inputs: ArrayLike, history: ArrayLike | None = None) -> Array:
        """Poses (..., T + 1, 3) from a pose (..., 3) under commands (..., T, 2)."""

    def linearize(
        self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None = None
    ) -> Linearization:
        """Predictions and Jacobians at many points at once."""

    def noise(self, u: ArrayLike) -> Array:
        """Covariances (..., 3, 3) of the one-step residual for commands (..., 2)."""


UNMODELLED_DELAY = "unmodelled_delay"  # key of a model's `info`; see `unmodelled_delay`


def unmodelled_delay(model: MotionModel) -> float:
    """How late the robot answers beyond what its model knows [s]."""
    return 0.0 if model.history else float(model.info.get(UNMODELLED_DELAY, 0.0))


class ScaledModel:
    """A model that is asked, and answers, in the robot's own units.

    `model`: in metres and seconds. `scale`: the units.
    """

    def __init__(self, model: KoopmanModel, scale: Scale) -> None:
        self.model, self.scale = model, scale
        self.inputs = model.inputs
        self.dt, self.history, self.info = model.dt / scale.time, model.history, model.info
        delay = unmodelled_delay(model)
        if delay:
            self.info = {**model.info, UNMODELLED_DELAY: delay / scale.time}
        self._state, self._command = scale.state, scale.command
        self._by_state = scale.state / scale.state[:, None]
        self._by_command = scale.command / scale.state[:, None]
        self.noise_model: NoiseModel | None = None
        if model.noise_model is not None:
            powers = np.array((1.0, *scale.command[[0, -1]] ** 2))
            between = scale.state * scale.state[:, None]
            coefficients = model.noise_model.coefficients * powers[:, None, None] / between
            found = model.noise_model.sources
            sources = None if found is None else _sources_in_units(found, scale)
            self.noise_model = replace(
                model.noise_model, coefficients=coefficients, sources=sources
            )

    def predict(self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None = None) -> Array:
        """As `KoopmanModel.predict`, in units."""
        states = np.asarray(x, dtype=float) * self._state
        out: Array = self.model.predict(states, self._commands(u), self._past(history))
        out /= self._state
        return out

    def rollout(self, x0: ArrayLike, inputs: ArrayLike, history: ArrayLike | None = None) -> Array:
        """As `KoopmanModel.rollout`, in units."""
        states = np.asarray(x0, dtype=float) * self._state
        out: Array = self.model.rollout(states, self._commands(inputs), self._past(history))
        out /= self._state
        return out

    def linearize(
        self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None = None
    ) -> Linearization:
        """As `KoopmanModel.linearize`, in units."""
        states = np.asarray(x, dtype=float) * self._state
        lin = self.model.linearize(states, self._commands(u), self._past(history))
        return Linearization(
            lin.value / self._state,
            lin.A * self._by_state,
            lin.B * self._by_command,
            lin.B_past * self._by_command,
        )

    def noise(self, u: ArrayLike) -> Array:
        """As `KoopmanModel.noise`, in units."""
        between = self._state * self._state[:, None]
        out: Array = self.model.noise(self._commands(u)) / between
        return out

    def _commands(self, u: ArrayLike) -> Array:
        out: Array = np.asarray(u, dtype=float) * self._command
        return out

    def _past(self, history: ArrayLike | None) -> Array | None:
        return None if history is None else self._commands(history)


def _sources_in_units(sources: NoiseSources, scale: Scale) -> NoiseSources:
    """Give variances in metres and seconds in the robot's units."""
    by_state, by_command = scale.state**2, (scale.command[[0, -1]] ** 2)[:, None]
    return NoiseSources(
        sources.pose / by_state,
        sources.pose_by_speed * scale.command[0] ** 2 / by_state,
        sources.white * by_command / by_state,
        sources.lasting * (by_command * scale.time**2) / by_state,
    )
