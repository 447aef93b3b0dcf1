"""How the driver of a motor board is built from a robot file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Self

from firmware_bridge.kinematics import KINDS, Geometry
from firmware_bridge.link import Transport
from firmware_bridge.options import from_table


def geometry_of(table: Mapping[str, Any]) -> Geometry:
    """Read wheels and ``[geometry]`` of a robot file; ConfigError names a wrong key."""
    kind = KINDS[table.get("wheels", "differential")]
    return from_table(kind, table.get("geometry", {}), "geometry")


class MotorBoard:
    """A driver whose arguments are a transport, the robot's geometry, and its board's options."""

    board: ClassVar[str] = "board"
    options_type: ClassVar[type[Any]]
    """Of the ``[board]`` section of a robot file."""

    @classmethod
    def from_options(cls, transport: Transport, table: Mapping[str, Any]) -> Self:
        """Build it from wheels, ``[geometry]`` and ``[board]`` of a robot file.

        ConfigError names a wrong key.
        """
        geometry = geometry_of(table)
        # each board's third argument are its own options
        build: Callable[..., Self] = cls
        return build(
            transport, geometry, from_table(cls.options_type, table.get("board", {}), "board")
        )
