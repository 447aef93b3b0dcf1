"""How the driver of a motor board is built from a robot file."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, Self

from firmware_bridge.kinematics import KINDS, Geometry
from firmware_bridge.link import OnBytes, Transport
from firmware_bridge.options import from_table


def geometry_of(table: Mapping[str, Any]) -> Geometry:
    """Read wheels and ``[geometry]`` of a robot file; ConfigError names a wrong key."""
    kind = KINDS[table.get("wheels", "differential")]
    return from_table(kind, table.get("geometry", {}), "geometry")


class MotorBoard:
    """A driver whose arguments are a transport, the robot's geometry, and its board's options."""

    board: ClassVar[str] = "board"
    options_type: ClassVar[type[Any]]  # of the ``[board]`` section of a robot file

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


class TickingDriver(MotorBoard):
    """What drivers of such boards share: the thread, and how they are stopped and closed.

    `transport`: not yet started; the driver starts and closes it. `geometry`: of the robot.
    """

    tick: ClassVar[float]  # between two reminders [s]

    def __init__(self, transport: Transport, geometry: Geometry) -> None:
        self._transport, self._geometry = transport, geometry
        self._lock = threading.Condition()
        self._thread: threading.Thread | None = None
        self._closing = self._started = self._released = False

    def stop(self) -> None:
        """Zero, and nothing but zero until zero is commanded."""
        with self._lock:
            self._released = True
            self._halt()

    def close(self) -> None:
        """Zero as the last word, then close the link; idempotent."""
        with self._lock:
            if self._closing:
                return
            self._closing = True
            self._lock.notify_all()
        if self._thread is not None:
            self._thread.join()
        if self._started:
            self._halt()
        self._transport.close()

    def _start(self, on_bytes: OnBytes) -> None:
        """Open the link, and begin to remind the board."""
        self._transport.start(on_bytes)
        self._started = True
        self._thread = threading.Thread(
            target=self._run, name=f"bridge-{self.board.lower()}", daemon=True
        )
        self._thread.start()

    def _halt(self) -> None:
        """Write zero."""
        raise NotImplementedError

    def _remind(self, now: float) -> None:
        """Write what the board must hear again; the lock is held."""
        raise NotImplementedError

    def _run(self) -> None:
        with self._lock:
            while not self._closing:
                self._remind(time.monotonic())
                self._lock.wait_for(lambda: self._closing, self.tick)
