"""Random driving to learn from: the paper's four sign scenarios, turned back before a fence."""

from __future__ import annotations

import math
import random

from firmware_bridge.messages import ConfigError, State, VelocityCommand
from firmware_bridge.safety.limits import Limits

SIGNS = ((1, 1), (1, -1), (-1, 1), (-1, -1))
"""Of v and omega, one scenario after the other (paper, sec. V.B)."""
REACTION = 0.8
"""Pose delay, control period and the vehicle's own lag, with room to spare [s]."""
TURN_GAIN = 2.0
"""Turn rate towards the middle per heading error [1/s]."""


class Excitation:
    """A controller that drives at random: state -> command.

    Commands are uniform within one scenario's signs and held for `hold`. Near the fence it turns
    towards the middle, in the direction of travel of the scenario, and goes on at random once it is
    well inside again.

    Parameters
    ----------
    fence : tuple
        xmin, ymin, xmax, ymax [m]; free of obstacles.
    limits : Limits
        Commands stay within.
    hold : float
        How long a command is held [s].
    scenario_time : float
        How long a scenario lasts [s].
    seed : int
        Of the commands.

    Raises
    ------
    ConfigError
        Where the fence is too small for the speed.
    """

    def __init__(
        self,
        fence: tuple[float, float, float, float],
        limits: Limits,
        hold: float = 0.5,
        scenario_time: float = 15.0,
        seed: int = 0,
    ) -> None:
        fastest = max(limits.v_max, limits.v_reverse)
        margin = fastest * REACTION + fastest**2 / (2.0 * limits.deceleration) + 0.05
        width, height = fence[2] - fence[0], fence[3] - fence[1]
        if min(width, height) < 4.0 * margin:
            raise ConfigError(
                f"geofence: {width:g} m x {height:g} m is too small to drive in at random at "
                f"{fastest:g} m/s: "
                f"expected at least {4.0 * margin:.2f} m each way, "
                "or a lower limits.v_max and v_reverse"
            )
        self._middle = ((fence[0] + fence[2]) / 2.0, (fence[1] + fence[3]) / 2.0)
        self._half = (width / 2.0 - margin, height / 2.0 - margin)
        self._limits, self._hold, self._scenario_time = limits, hold, scenario_time
        self._random = random.Random(seed)
        self._signs = SIGNS if limits.v_reverse > 0.0 else SIGNS[:2]
        self._began: float | None = None
        self._until = -math.inf
        self._command = (0.0, 0.0)
        self.returning = False
        """Whether it is on its way back to the middle."""

    def __call__(self, state: State) -> VelocityCommand:
        """Give the command for now."""
        now = state.stamp
        self._began = now if self._began is None else self._began
        signs = self._signs[int((now - self._began) / self._scenario_time) % len(self._signs)]
        x, y = state.x - self._middle[0], state.y - self._middle[1]
        out = max(abs(x) / self._half[0], abs(y) / self._half[1])
        self.returning = out > (0.6 if self.returning else 1.0)
        if self.returning:
            self._until = -math.inf
            v, omega = self._back(x, y, state.theta, signs[0])
        else:
            if now >= self._until:
                self._until = now + self._hold
                fastest = self._limits.v_max if signs[0] > 0 else self._limits.v_reverse
                self._command = (
                    signs[0] * self._random.uniform(0.0, fastest),
                    signs[1] * self._random.uniform(0.0, self._limits.omega_max),
                )
            v, omega = self._command
        return VelocityCommand(v, omega, now)

    def _back(self, x: float, y: float, theta: float, sign: int) -> tuple[float, float]:
        """Turn the end that leads towards the middle, and drive as far as it points there."""
        leading = theta if sign > 0 else theta + math.pi
        error = math.remainder(math.atan2(-y, -x) - leading, math.tau)
        fastest = self._limits.v_max if sign > 0 else self._limits.v_reverse
        omega = max(-self._limits.omega_max, min(self._limits.omega_max, TURN_GAIN * error))
        return sign * fastest * max(0.0, math.cos(error)), omega
