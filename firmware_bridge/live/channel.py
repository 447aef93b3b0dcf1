"""Plain data between the process that drives and the one that serves pages.

A packet arrives whole or not at all, and sending never waits: what the other end does not take is
left out. `marshal` packs arrays of numbers without looking at each, so that whoever drives is not
held up; it is read from a parent or a child of the same Python only, never from a file or a
network.
"""

from __future__ import annotations

import marshal
import socket
from typing import Any, Self

LONGEST = 192 * 1024  # of one packet [bytes]: Linux takes 208 KB at once
Packet = dict[str, Any]
"""Strings, numbers, lists, dicts, None, and float64 arrays as bytes, under a name."""


class Channel:
    """One end of a pair of connected sockets."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self.socket = end

    @classmethod
    def pair(cls) -> tuple[Self, Self]:
        """Make both ends."""
        one, other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        return cls(one), cls(other)

    @classmethod
    def inherited(cls, descriptor: int) -> Self:
        """Take the end that a parent left open."""
        return cls(socket.socket(fileno=descriptor))

    def send(self, packet: Packet) -> bool:
        """Send a packet; False if it was left out: too long, or the other end is busy or gone.

        Raises ValueError for values that are not plain data.
        """
        data = marshal.dumps(packet)
        if len(data) > LONGEST:
            return False
        try:
            return self.socket.send(data) == len(data)
        except OSError:
            return False

    def receive(self) -> Packet | None:
        """Give the next packet, None if there is none yet.

        Raises EOFError if the other end is gone.
        """
        try:
            data = self.socket.recv(LONGEST)
        except BlockingIOError:
            return None
        except OSError as error:
            raise EOFError from error
        if not data:
            raise EOFError
        packet = marshal.loads(data)
        assert isinstance(packet, dict)
        return packet

    def close(self) -> None:
        """Close this end."""
        self.socket.close()
