"""A driver with eyes: the robot must not drive without fresh scans of its lidar."""

from __future__ import annotations

import math
import threading
from dataclasses import replace

from firmware_bridge.drivers import Driver
from firmware_bridge.messages import LidarError, LinkError, LinkStatus, State
from firmware_bridge.sensors.lidar.kinds import open_lidar
from firmware_bridge.sensors.lidar.lidar import Lidar
from firmware_bridge.sensors.lidar.options import LidarOptions
from firmware_bridge.sensors.sensor_driver import SensorDriver
from firmware_bridge.sensors.sight import FrozenScan, Sight, Sweep


def with_lidar(driver: Driver, options: LidarOptions) -> SightedDriver:
    """Give a driver the lidar of a robot file, on a link of its own."""
    return SightedDriver(driver, open_lidar(options), options)


class SightedDriver(SensorDriver):
    """A driver whose status tells the age and the faults of a lidar, too.

    `driver`: not yet connected. `lidar`: not yet connected; it is opened and closed with the
    driver. `options`: of the lidar.
    """

    def __init__(self, driver: Driver, lidar: Lidar, options: LidarOptions) -> None:
        super().__init__(driver)
        self.lidar, self.options = lidar, options
        self.sight = Sight(options, self.sweep)  # what the lidar sees, from where the robot is
        self._counted: Sweep | None = None
        self._covered: Sweep | None = None
        self._looked: Sweep | None = None
        self._frozen_scan, self._frozen = FrozenScan(), False
        self._lock = threading.Lock()  # the gate's thread and the planner's ask

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
        """Newest turn of which enough beams are known, and that is not an old one again."""
        with self._lock:
            sweep = self.lidar.sweep()
            if sweep is None or sweep is self._looked:
                return self._counted
            self._looked = sweep
            self._frozen = self._frozen_scan.repeats(sweep, self.inner.state())
            free = self.options.no_return == "free"
            enough = free or sweep.returns >= self.options.returns
            self._covered = None if enough else sweep
            if enough and not self._frozen:
                self._counted = sweep
            return self._counted

    def health(self) -> LinkStatus:
        """Status of the board, with the age of the newest scan."""
        status, lidar, sweep = self.inner.health(), self.lidar.health(), self.sweep()
        covered = self._covered
        faults = lidar.faults
        if covered is not None:
            share = f"{100.0 * covered.returns:.0f} %"
            faults += (f"lidar: only {share} of its beams are known: is it covered?",)
        if self._frozen:
            faults += (
                "lidar: its turns repeat each other to the last digit while the robot moves: it is "
                "frozen: switch it off and on",
            )
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
