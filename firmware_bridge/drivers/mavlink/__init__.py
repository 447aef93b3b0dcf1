"""MAVLink driver for ArduPilot Rover."""

from firmware_bridge.drivers.mavlink.driver import MavlinkDriver

__all__ = ["MavlinkDriver"]
