"""The driver of boards that answer in lines of text."""

from __future__ import annotations

from collections.abc import Hashable

from firmware_bridge.drivers.polled.driver import PolledDriver
from firmware_bridge.drivers.polled.options import PolledOptions
from firmware_bridge.kinematics import WheelGeometry, WheelOdometry
from firmware_bridge.link import Transport
from firmware_bridge.link.framing import Lines


class LineDriver(PolledDriver):
    """A `PolledDriver` that cuts what comes into lines, and counts those that make no sense.

    A subclass takes each line.

    Parameters
    ----------
    transport, geometry, odometry, options
        As `PolledDriver` takes them.
    """

    def __init__(
        self,
        transport: Transport,
        geometry: WheelGeometry,
        odometry: WheelOdometry,
        options: PolledOptions,
    ) -> None:
        super().__init__(transport, geometry, odometry, options)
        self._lines, self._bad_lines = Lines(), 0

    def _take_line(self, line: bytes, stamp: float) -> bool:
        """Take a line without its end; False where it makes no sense."""
        raise NotImplementedError

    def _begin(self, key: Hashable) -> None:
        self._lines.reset()

    def _feed(self, data: bytes, stamp: float) -> None:
        with self._changed:
            lines = self._lines.feed(data)
        for line in lines:
            self._bad_lines += not self._take_line(line, stamp)

    def _damaged(self) -> int:
        return self._lines.bad + self._bad_lines
