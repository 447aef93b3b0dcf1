"""Drivers around another: with a sensor on it, or with its poses given in another frame."""

from __future__ import annotations

import math
from dataclasses import replace

from firmware_bridge.drivers import Autopilot, Driver
from firmware_bridge.messages import LinkStatus, State


class SensorDriver:
    """A driver that adds a sensor to another.

    `driver`: commands go to it as they are.
    """

    def __init__(self, driver: Driver) -> None:
        self.inner = driver
        self.send, self.stop = driver.send, driver.stop


def autopilot_of(driver: Driver | SensorDriver) -> Autopilot | None:
    """The autopilot behind a driver, beneath all sensors on it; None for a motor controller."""
    while isinstance(driver, SensorDriver):
        driver = driver.inner
    return driver if isinstance(driver, Autopilot) else None


def placed(state: State, origin: tuple[float, float, float]) -> State:
    """Tell a state in the frame in which its own lies at `origin` [m, m, rad]."""
    x, y, theta = origin
    cos, sin = math.cos(theta), math.sin(theta)
    return replace(
        state,
        x=x + cos * state.x - sin * state.y,
        y=y + sin * state.x + cos * state.y,
        theta=state.theta + theta,
    )


class PlacedDriver:
    """Moves a driver's poses into the frame in which the vehicle's own lies at `origin`.

    `driver`: poses in the vehicle's own frame: where it was switched on, or the autopilot's origin.
    `origin`: x, y [m], theta [rad] of that frame.
    """

    def __init__(self, driver: Driver, origin: tuple[float, float, float]) -> None:
        self.inner, self._origin = driver, origin
        self.connect = driver.connect
        self.send = driver.send
        self.stop = driver.stop
        self.close = driver.close

    def state(self) -> State | None:
        """Newest state, in our frame."""
        state = self.inner.state()
        return None if state is None else placed(state, self._origin)

    def health(self) -> LinkStatus:
        """What is known of the other end."""
        return self.inner.health()
