"""What every link offers: bytes in, bytes out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

OnBytes = Callable[[bytes, float], None]
"""Called in the I/O thread with what arrived and `time.monotonic()`."""


class Transport(Protocol):
    """One open link. One I/O thread owns the port; writing never blocks."""

    def start(self, on_bytes: OnBytes) -> None:
        """Open and start the I/O thread; raises LinkError if the first opening fails."""
        ...

    def write(self, data: bytes) -> bool:
        """Queue one whole frame; a full queue drops its oldest. False if the link is down."""
        ...

    @property
    def connected(self) -> bool:
        """Whether the port is open now."""
        ...

    @property
    def counters(self) -> dict[str, int]:
        """bytes_in, bytes_out, reconnects, dropped_frames, refused_writes, errors."""
        ...

    @property
    def last_error(self) -> str:
        """Why the link last went down, in words; empty if it never did."""
        ...

    def close(self) -> None:
        """Stop the thread and close the port; idempotent."""
        ...
