"""What the drivers of serial motor controllers share: they ask a board, round by round."""

from firmware_bridge.drivers.polled.driver import LineDriver, PolledDriver
from firmware_bridge.drivers.polled.thread import NoReply

__all__ = ["LineDriver", "NoReply", "PolledDriver"]
