"""Browsers that watch: each gets the newest, as fast as it takes it, and none waits for another."""

from __future__ import annotations

import asyncio
import socket
import time

from firmware_bridge.live.picture import Picture

MOST = 128
"""More watchers than this are turned away."""
BUFFER = 65536
"""Of the kernel's, for one watcher [bytes]: what waits there is old."""
STUCK = 5.0
"""A watcher that has taken nothing for so long is dropped [s]."""


class Watcher:
    """One stream of events."""

    def __init__(self, writer: asyncio.StreamWriter, now: float) -> None:
        self._writer, self._since = writer, now
        self.behind = True
        """Whether it has missed a change: it gets everything next."""
        peer = writer.get_extra_info("socket")
        peer.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER)

    def offer(self, text: str, now: float) -> bool:
        """Send an event if the last one has left; False where the watcher is stuck or gone."""
        transport = self._writer.transport
        if transport.is_closing():
            return False
        if transport.get_write_buffer_size():
            self.behind = True
            if now - self._since > STUCK:
                transport.abort()
                return False
            return True
        self._since = now
        self._writer.write(f"data: {text}\n\n".encode())
        return True


class Watchers:
    """All streams.

    Parameters
    ----------
    picture : Picture
        What they are shown.
    """

    def __init__(self, picture: Picture) -> None:
        self._picture = picture
        self._all: set[Watcher] = set()

    def __len__(self) -> int:
        return len(self._all)

    def add(self, writer: asyncio.StreamWriter) -> Watcher | None:
        """Take one more, and show it everything; None where there are too many."""
        if len(self._all) >= MOST:
            return None
        watcher = Watcher(writer, time.monotonic())
        self._all.add(watcher)
        self._show(watcher, "", self._picture.whole())
        return watcher

    def remove(self, watcher: Watcher) -> None:
        """Forget one that has gone."""
        self._all.discard(watcher)

    def tell(self, change: str) -> None:
        """Show all of them a change."""
        whole = ""
        for watcher in list(self._all):
            if watcher.behind and not whole:
                whole = self._picture.whole()
            self._show(watcher, change, whole)

    def _show(self, watcher: Watcher, change: str, whole: str) -> None:
        was_behind, watcher.behind = watcher.behind, False
        if not watcher.offer(whole if was_behind else change, time.monotonic()):
            self._all.discard(watcher)
