"""A driver with eyes: the robot must not drive without fresh scans of its lidar."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from firmware_bridge.drivers import Driver
from firmware_bridge.messages import LidarError, LinkError, LinkStatus, State
from firmware_bridge.sensors.lidar.kinds import open_lidar
from firmware_bridge.sensors.lidar.lidar import Lidar
from firmware_bridge.sensors.lidar.options import LidarOptions
from firmware_bridge.sensors.scan import Sweep
from firmware_bridge.sensors.sight import Sight


def with_lidar(driver: Driver, options: LidarOptions) -> SightedDriver:
    """Give a driver the lidar of a robot file, on a link of its own or the driver's."""
    lidar = getattr(driver, "sectors", None) or open_lidar(options)
    return SightedDriver(driver, lidar, options)


class SightedDriver:
    """A driver whose status tells the age and the faults of a lidar, too.

    Parameters
    ----------
    driver : Driver
        Not yet connected.
    lidar : Lidar
        Not yet connected; it is opened and closed with the driver.
    options : LidarOptions
        Of the lidar.
    """

    def __init__(self, driver: Driver, lidar: Lidar, options: LidarOptions) -> None:
        self.inner, self.lidar, self.options = driver, lidar, options
        self.send, self.stop = driver.send, driver.stop
        self.sight = Sight(options, self.sweep)
        """What the lidar sees, from where the robot is."""
        self._counted: Sweep | None = None
        self._covered: Sweep | None = None

    def connect(self, timeout: float) -> None:
        """Connect the lidar, then the driver: a robot that cannot see is not taken."""
        try:
            self.lidar.connect(self.options.timeout)
        except LinkError as error:
            raise LidarError(f"lidar: {str(error).removeprefix('lidar: ')}") from None
        self.inner.connect(timeout)

    def state(self) -> State | None:
        """Newest state."""
        return self.inner.state()

    def sweep(self) -> Sweep | None:
        """Newest turn of which enough beams say something."""
        sweep = self.lidar.sweep()
        if sweep is None or sweep is self._counted:
            return self._counted
        free = self.options.no_return == "free"
        if free or sweep.returns >= self.options.returns:
            self._counted, self._covered = sweep, None
        else:
            self._covered = sweep
        return self._counted

    def health(self) -> LinkStatus:
        """Status of the board, with the age of the newest scan."""
        status, lidar, sweep = self.inner.health(), self.lidar.health(), self.sweep()
        covered = self._covered
        faults = lidar.faults
        if covered is not None:
            share = f"{100.0 * covered.returns:.0f} %"
            faults += (f"lidar: only {share} of its beams say something: is it covered?",)
        return replace(
            status,
            scan_stamp=-math.inf if sweep is None else sweep.stamp,
            scan_faults=faults,
            counters={**status.counters, **{f"lidar_{k}": v for k, v in lidar.counters.items()}},
        )

    def close(self) -> None:
        """Close the driver, then the lidar."""
        self.inner.close()
        self.lidar.close()

    def __getattr__(self, name: str) -> Any:
        """Whatever else the driver has: notes, asking an autopilot for control."""
        return getattr(self.inner, name)
