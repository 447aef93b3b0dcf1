"""A board that a thread of its own reminds of what holds; commands are written at once."""

from __future__ import annotations

import threading
import time
from typing import ClassVar

from firmware_bridge.drivers.motor_board import MotorBoard
from firmware_bridge.kinematics import Geometry
from firmware_bridge.link import OnBytes, Transport


class TickingDriver(MotorBoard):
    """What drivers of such boards share: the thread, and how they are stopped and closed.

    `transport`: not yet started; the driver starts and closes it. `geometry`: of the robot.
    """

    tick: ClassVar[float]
    """Between two reminders [s]."""

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
