"""The drivers that serial motor controllers share: odometry, commands, health; lines of text.

The pose is what the board's counters give, where it can be true.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Hashable, Mapping
from typing import Any

from firmware_bridge.drivers.polled.thread import SILENCE, PollingThread
from firmware_bridge.link.framing import Lines
from firmware_bridge.messages import LinkError, LinkStatus, State


def why_silent(
    down: str, counters: Mapping[str, int], faults: tuple[str, ...], timeout: float, hint: str
) -> str:
    """Say what is missing.

    `down`: why the link is down; empty if it is up. `counters`: of the link and of the exchange.
    `faults`: what the board complains of. `timeout`: how long was waited [s]. `hint`: what a user
    of this board should look at.
    """
    if down:
        return down
    if faults and counters["frames"]:
        return f"answers, but cannot drive: {'; '.join(faults)}"
    if counters["bytes_in"] == 0:
        return f"no answer within {timeout:g} s: {hint}"
    if counters["frames"] == 0:
        return (
            f"{counters['bytes_in']} bytes came and none made sense: "
            f"wrong baud rate or protocol? {hint}"
        )
    missing = f"{counters['timeouts']} are missing"
    return f"answers come, but too few within {timeout:g} s: {missing}: {hint}"


class PolledDriver(PollingThread):
    """A `Driver` that asks a board for its counters, one request under way at a time.

    A subclass builds the frames: what `Board` asks for.

    Parameters
    ----------
    transport : Transport
        Not yet started; the driver starts and closes it.
    geometry : Geometry
        Of the robot.
    odometry : WheelOdometry
        Fits the board's counters.
    options : PolledOptions
        How often the board is asked, and how long replies and commands last.
    """

    def connect(self, timeout: float) -> None:
        """Open the link, set the board up and wait for its first counters."""
        try:
            self._transport.start(self._feed)
        except LinkError:
            self.close()
            raise
        self._thread = threading.Thread(
            target=self._run, name=f"bridge-{self.board.lower()}", daemon=True
        )
        self._thread.start()
        with self._changed:
            done = self._changed.wait_for(
                lambda: self._configured and self._armed and self._pose.state is not None, timeout
            )
        if not done:
            counters = {**self._transport.counters, **self._exchange.counters}
            down = "" if self._transport.connected else "the link is down"
            down = down and (self._transport.last_error or down)
            faults = self._errors + self._trouble
            reason = why_silent(down, counters, faults, timeout, self.hint)
            self.close()
            raise LinkError(f"{self.board}: {reason}")

    def state(self) -> State | None:
        """Newest odometry."""
        return self._pose.state

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        """Command speeds: written at once, or after the reply that is under way."""
        wheels, now = self._geometry.wheels(v, omega, vy), time.monotonic()
        with self._changed:
            self._held.put(self._geometry.to_channels(*wheels), now)
            if not any(wheels):
                self._released = False  # only standing still may take the motors back
            if self._steering is not None and not self._released:
                self._steering.command(v, omega, now)
            if not self.answers_commands:
                self._send_pending()
            self._changed.notify_all()

    def stop(self) -> None:
        """Zero speed, then release the motors; the next zero command takes them back."""
        with self._changed:
            self._held.put(self._geometry.still, time.monotonic())
            self._released = True
            if not self.answers_commands:
                self._send_pending()
            self._changed.notify_all()

    def health(self) -> LinkStatus:
        """What is known of the board."""
        now = time.monotonic()
        with self._changed:
            jumped = self._pose.jumped(now)
            faults = self._errors + self._trouble
            faults += self._dead.faults() + self._runaway.faults()
            if jumped:
                faults += (
                    "the wheel counters jumped: the board was restarted, or a reply was damaged",
                )
            if self._exchange.strangers(now):
                faults += ("unsolicited replies: does another program talk to the board?",)
            fresh = now - self._exchange.heard < SILENCE
            connected = self._transport.connected
            if not connected and self._transport.last_error:
                faults += (self._transport.last_error,)
            return LinkStatus(
                connected=connected,
                heartbeat_stamp=self._exchange.heard,
                pose_stamp=self._pose.stamp,
                ready=connected
                and self._configured
                and fresh
                and self._armed
                and not self._errors
                and not self._released,
                pose_ok=self._estimate_ok and not jumped,
                armed=self._armed and not self._released,
                mode="; ".join((*filter(None, (self._mode,)), *self._warnings)),
                faults=faults,
                restarted=self._pose.restarted(now),
                counters={
                    **self._transport.counters,
                    **self._exchange.counters,
                    **self._counters,
                    "bad_bytes": self._damaged(),
                },
            )

    def close(self) -> None:
        """Zero speed as the last word, then close the link."""
        with self._changed:
            if self._exchange.closing:
                return
            self._exchange.closing = True
            self._changed.notify_all()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self._transport.close()


class LineDriver(PolledDriver):
    """A `PolledDriver` that cuts what comes into lines, and counts those that make no sense.

    A subclass takes each line.
    """

    def __init__(self, *of: Any) -> None:
        super().__init__(*of)
        self._lines, self._bad_lines = Lines(), 0

    def _take_line(self, line: bytes, stamp: float) -> bool:
        """Take a line without its end; False if it makes no sense."""
        raise NotImplementedError

    def _begin(self, key: Hashable) -> None:
        self._lines.reset()

    def _feed(self, data: bytes, stamp: float) -> None:
        with self._changed:
            lines = self._lines.feed(data)
        for line in lines:
            self._bad_lines += not self._take_line(line, stamp)

    def _damaged(self) -> int:
        return self._lines.bad + self._bad_lines
