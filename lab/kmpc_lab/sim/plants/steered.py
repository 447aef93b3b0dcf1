"""Cars and omnis: a bicycle whose servo takes time, and mecanum wheels that slip sideways."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.wheels import Car
from kmpc_lite.geometry import exact_arc
from kmpc_lite.types import Array

FINEST = 0.02
"""Longest step in which a servo's curvature is held [s]."""
CREEPS = 1e-6
"""Speed below which a command says nothing of how the wheels are steered [m/s]."""
SIDEWAYS = 2.0
"""How many times as much as wheels the rollers of mecanum wheels slip."""


class SteeredDrive:
    """A car that slips: its wheels stay steered as they are while it stands.

    ``omega = v kappa / (1 + K v^2)``; the curvature kappa follows ``omega / v`` of the command as
    fast as the servo turns.

    `car`: turning radius and steering rate. `slip`: mean of the exponential slip ratios of speed,
    sideways and of turns, drawn every period. `understeer`: k [s^2/m^2]. `offset`: curvature in
    which it drives when it is commanded to drive straight [1/m]. `backward_gain`: share of a
    commanded speed that happens backwards. `seed`: of the slip.

    Examples
    --------
    >>> SteeredDrive(Car(0.5)).trace([0.0, 0.0, 0.0], [1.0, 9.0], 0.1, 1).round(3) + 0.0
    array([[0.099, 0.01 , 0.2  ]])
    """

    def __init__(
        self,
        car: Car,
        slip: float = 0.0,
        understeer: float = 0.0,
        offset: float = 0.0,
        backward_gain: float = 1.0,
        seed: int = 0,
    ) -> None:
        self._car, self._slip, self._understeer = car, slip, understeer
        self._offset, self._backward_gain = offset, backward_gain
        self._random = np.random.default_rng(seed)
        self.reset()

    def reset(self) -> None:
        """Steer straight; the slip goes on at random."""
        self._curvature = 0.0

    def trace(self, x: ArrayLike, u: ArrayLike, dt: float, substeps: int) -> Array:
        """Evenly spaced states (substeps, 3) during one period, without the first."""
        state, (speed, turn_rate) = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
        wanted = self._curvature if abs(speed) < CREEPS else turn_rate / speed
        wanted = float(np.clip(wanted, -self._car.curvature, self._car.curvature))
        rate = np.inf if self._car.steering_rate is None else self._car.steering_rate
        slips = self._random.exponential(1.0, 3) * self._slip
        v = speed * (self._backward_gain if speed < 0.0 else 1.0)
        path = np.empty((substeps, 3))
        parts = max(int(np.ceil(dt / substeps / FINEST)), 1)
        h = dt / substeps / parts
        for i in range(substeps):
            for _ in range(parts):
                self._curvature += float(np.clip(wanted - self._curvature, -rate * h, rate * h))
                omega = v * (self._curvature + self._offset) / (1.0 + self._understeer * v * v)
                moved = (1.0 + slips[0]) * v, (1.0 + slips[2]) * omega
                state = exact_arc(state, *moved, h, -slips[1] * v)
            path[i] = state
        return path


class MecanumDrive:
    """An omni whose rollers slip, sideways the most.

    `slip`: mean of the exponential slip ratios, drawn every period: of what is commanded ahead and
    round; twice that sideways. `seed`: of the slip.

    Examples
    --------
    >>> MecanumDrive().trace([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.1, 1).round(3)
    array([[0. , 0.1, 0. ]])
    """

    def __init__(self, slip: float = 0.0, seed: int = 0) -> None:
        self._slip, self._random = slip, np.random.default_rng(seed)

    def reset(self) -> None:
        """Nothing to forget."""

    def trace(self, x: ArrayLike, u: ArrayLike, dt: float, substeps: int) -> Array:
        """Evenly spaced states (substeps, 3) during one period, without the first."""
        slips = self._random.exponential(1.0, 3) * self._slip * (1.0, SIDEWAYS, 1.0)
        ahead, left, omega = np.asarray(u, dtype=float) * np.maximum(1.0 - slips, 0.0)
        times = dt / substeps * np.arange(1, substeps + 1)
        return exact_arc(np.asarray(x, dtype=float), ahead, omega, times, left)
