"""What drivers with a sensor on them share, and the autopilot that may be beneath."""

from __future__ import annotations

from firmware_bridge.drivers import Autopilot, Driver


class SensorDriver:
    """A driver that adds a sensor to another.

    Parameters
    ----------
    driver : Driver
        Commands go to it as they are.
    """

    def __init__(self, driver: Driver) -> None:
        self.inner = driver
        self.send, self.stop = driver.send, driver.stop


def autopilot_of(driver: Driver | SensorDriver) -> Autopilot | None:
    """The autopilot behind a driver, beneath all sensors on it; None for a motor controller."""
    while isinstance(driver, SensorDriver):
        driver = driver.inner
    return driver if isinstance(driver, Autopilot) else None
