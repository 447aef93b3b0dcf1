"""A board that plans by itself: what `kmpc export` writes, on a microcontroller."""

from firmware_bridge.drivers.onboard.driver import OnboardDriver, OnboardOptions
from firmware_bridge.drivers.onboard.messages import About, Telemetry

__all__ = ["About", "OnboardDriver", "OnboardOptions", "Telemetry"]
