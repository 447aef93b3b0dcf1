"""Serial ports of this machine: USB ones by names that stay the same, and those of the board."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

BUILT_IN = ("ttyAMA*", "ttyTHS*", "serial[0-9]*")
"""Ports of a Raspberry Pi's or a Jetson's header."""
PLUGGED_IN = ("ttyACM*", "ttyUSB*")


class Port(NamedTuple):
    """A serial port."""

    path: str
    """What a robot file should say."""
    device: str
    """What it is now: /dev/ttyACM0."""


def serial_ports(root: Path = Path("/dev")) -> list[Port]:
    """List the ports, those that are plugged in first.

    Parameters
    ----------
    root : Path
        Folder of devices.
    """
    found: dict[str, Port] = {}
    for link in sorted((root / "serial" / "by-id").glob("*")):
        device = str(link.resolve())
        found.setdefault(device, Port(str(link), device))
    for pattern in (*PLUGGED_IN, *BUILT_IN):
        for path in sorted(root.glob(pattern)):
            device = str(path.resolve())
            found.setdefault(device, Port(str(path), device))
    return list(found.values())
