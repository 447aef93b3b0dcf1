"""What the drivers of serial motor controllers share: they ask a board, round by round."""

from firmware_bridge.drivers.polled.driver import PolledDriver
from firmware_bridge.drivers.polled.exchange import NoReply
from firmware_bridge.drivers.polled.held_command import STANDSTILL
from firmware_bridge.drivers.polled.line_driver import LineDriver

__all__ = ["STANDSTILL", "LineDriver", "NoReply", "PolledDriver"]
