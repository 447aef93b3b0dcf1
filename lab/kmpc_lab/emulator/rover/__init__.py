"""An emulated ArduPilot rover."""
