"""Lets connections in: what is no request goes at once, and a STOP goes before everything else.

Whoever floods the port with connections makes us accept and close them, which is quick; only what
has said a whole request is given a stream, and but for STOP only so many a second are.
"""

from __future__ import annotations

import asyncio
import socket
import time
from collections.abc import Awaitable, Callable

from firmware_bridge.live.http import LONGEST_BODY, LONGEST_HEAD, PATIENCE

AT_ONCE = 64
"""Connections that are accepted in one go."""
WAITING = 512
"""Connections that may wait for that: one more would be tried again, a second later."""
HALF = 256
"""Connections that have not said a whole request yet; one more closes the oldest."""
RATE, BURST = 200.0, 128.0
"""Requests, but for STOP, that are answered in a second for long, and at once."""

Serve = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


class Door:
    """Accepts the connections of one listening socket.

    Parameters
    ----------
    listener : socket
        Listens already.
    serve : callable
        Answers one connection, whose whole request has been read.
    """

    def __init__(self, listener: socket.socket, serve: Serve) -> None:
        self._listener, self._serve = listener, serve
        self._half: dict[socket.socket, tuple[bytes, float]] = {}
        self._credit, self._stamp = BURST, time.monotonic()
        self._tasks: set[asyncio.Task[None]] = set()

    def open(self) -> None:
        """Begin, in the running loop."""
        self._listener.setblocking(False)
        self._listener.listen(WAITING)
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._listener, self._accept)

    def tidy(self) -> None:
        """Close connections that take too long to say what they want."""
        oldest = time.monotonic() - PATIENCE
        for peer in [p for p, (_, since) in self._half.items() if since < oldest]:
            self._forget(peer)

    def _accept(self) -> None:
        for _ in range(AT_ONCE):
            try:
                peer, _ = self._listener.accept()
            except OSError:  # no more, or gone again before it was taken
                return
            peer.setblocking(False)
            self._hear(peer, b"")

    def _hear(self, peer: socket.socket, said: bytes) -> None:
        """Read what there is of a request."""
        try:
            part = peer.recv(LONGEST_HEAD)
        except BlockingIOError:
            self._wait(peer, said)
            return
        except OSError:
            part = b""
        said += part
        begun = said.startswith((b"GET ", b"POST "))
        if not part or (len(said) > 4 and not begun) or len(said) > LONGEST_HEAD + LONGEST_BODY:
            self._forget(peer)
        elif b"\r\n\r\n" not in said:
            self._wait(peer, said)
        elif self._may_enter(said):
            self._let_in(peer, said)
        else:
            self._forget(peer)

    def _wait(self, peer: socket.socket, said: bytes) -> None:
        """Wait for the rest."""
        if peer in self._half:
            self._half[peer] = said, self._half[peer][1]
            return
        if len(self._half) >= HALF:
            self._forget(next(iter(self._half)))
        self._half[peer] = said, time.monotonic()
        self._loop.add_reader(peer, lambda: self._hear(peer, self._half[peer][0]))

    def _forget(self, peer: socket.socket) -> None:
        if self._half.pop(peer, None) is not None:
            self._loop.remove_reader(peer)
        peer.close()

    def _may_enter(self, said: bytes) -> bool:
        """Whether a request is answered now: a STOP always is."""
        if said.startswith(b"POST ") and b"/stop " in said.partition(b"\r\n")[0]:
            return True
        now = time.monotonic()
        self._credit = min(BURST, self._credit + RATE * (now - self._stamp))
        self._stamp = now
        if self._credit < 1.0:
            return False
        self._credit -= 1.0
        return True

    def _let_in(self, peer: socket.socket, said: bytes) -> None:
        if self._half.pop(peer, None) is not None:
            self._loop.remove_reader(peer)
        task = self._loop.create_task(self._answer(peer, said))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _answer(self, peer: socket.socket, said: bytes) -> None:
        reader = asyncio.StreamReader(limit=LONGEST_HEAD)
        reader.feed_data(said)
        protocol = asyncio.StreamReaderProtocol(reader)
        try:
            transport, _ = await self._loop.connect_accepted_socket(lambda: protocol, peer)
        except OSError:
            peer.close()
            return
        writer = asyncio.StreamWriter(transport, protocol, reader, self._loop)
        await self._serve(reader, writer)
