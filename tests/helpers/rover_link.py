"""A rover that can be armed at once, and a port for it."""

from __future__ import annotations

import socket

READY = {"arm_after": 0.2, "uptime": 5.0}
"""A rover that can be armed at once."""


def free_port(kind: int = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
