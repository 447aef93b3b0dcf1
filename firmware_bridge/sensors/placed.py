"""A driver whose poses are told in another frame: the scenario's."""

from __future__ import annotations

import math
from dataclasses import replace

from firmware_bridge.drivers import Driver
from firmware_bridge.messages import LinkStatus, State


class PlacedDriver:
    """Moves a driver's poses into the frame in which the vehicle's own lies at `origin`.

    Parameters
    ----------
    driver : Driver
        Poses in the vehicle's own frame: where it was switched on, or the autopilot's origin.
    origin : tuple
        x, y [m], theta [rad] of that frame.
    """

    def __init__(self, driver: Driver, origin: tuple[float, float, float]) -> None:
        self.inner = driver
        self._x, self._y, self._theta = origin
        self._cos, self._sin = math.cos(self._theta), math.sin(self._theta)
        self.connect, self.send, self.stop, self.close = (
            driver.connect,
            driver.send,
            driver.stop,
            driver.close,
        )

    def state(self) -> State | None:
        """Newest state, in our frame."""
        state = self.inner.state()
        if state is None:
            return None
        return replace(
            state,
            x=self._x + self._cos * state.x - self._sin * state.y,
            y=self._y + self._sin * state.x + self._cos * state.y,
            theta=state.theta + self._theta,
        )

    def health(self) -> LinkStatus:
        """What is known of the other end."""
        return self.inner.health()
