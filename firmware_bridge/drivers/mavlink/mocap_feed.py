"""Poses from motion capture on their way to the autopilot, and the origin that it needs once."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from firmware_bridge.drivers.mavlink.messages import MessageBuilder
from firmware_bridge.drivers.mavlink.options import MOCAP, MavlinkOptions

FUTURE = 0.05
"""A stamp may lie this far ahead of the time at which it is given [s]."""
PERIOD = 0.02
"""Least time between poses that are passed on [s]: a serial link has no room for all poses of a
faster motion capture."""


class MocapFeed:
    """Passes poses on, and refuses bad ones.

    `options`: whether there is motion capture, and the origin. `build`: builds messages to the
    vehicle. `send`: takes a message to put on the wire.
    """

    def __init__(
        self, options: MavlinkOptions, build: MessageBuilder, send: Callable[[Any], None]
    ) -> None:
        self._options, self._build, self._send = options, build, send
        self.stamp = -math.inf
        """Stamp of the newest pose [s]."""
        self.refused = 0
        self.has_origin = False
        """Whether the vehicle has an origin."""
        self._sent = -math.inf

    def feed(self, x: float, y: float, theta: float, stamp: float, now: float) -> None:
        """Pass a pose on; bad ones are refused and counted.

        Bad is what is not finite, from the future, or not newer than the last.
        """
        finite = all(map(math.isfinite, (x, y, theta, stamp)))
        if not finite or stamp > now + FUTURE or stamp <= self.stamp:
            self.refused += 1
            return
        self.stamp = stamp
        if stamp - self._sent >= PERIOD * 0.9:
            self._sent = stamp
            self._send(self._build.vision(x, y, theta, stamp))

    @property
    def wants_origin(self) -> bool:
        """Whether the vehicle is to be given an origin that it has not."""
        options = self._options
        return options.pose == MOCAP and options.origin is not None and not self.has_origin

    def send_origin(self) -> None:
        """Give the vehicle its origin."""
        assert self._options.origin is not None
        self._send(self._build.origin(*self._options.origin))
