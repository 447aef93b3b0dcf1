"""The latch of an emergency stop: a file whose presence means "pressed", whoever made it."""

from __future__ import annotations

import os
from pathlib import Path


def latch_file(socket_path: Path) -> Path:
    """Where the latch of a socket lies."""
    return socket_path.with_name(socket_path.name + ".latched")


def is_latched(socket_path: Path) -> bool:
    """Whether anything at all lies where the latch does."""
    return os.path.lexists(latch_file(socket_path))


def set_latch(socket_path: Path, latched: bool) -> None:
    """Write or remove the latch, down to the disk."""
    path = latch_file(socket_path)
    if not latched:
        path.unlink(missing_ok=True)
    elif not os.path.lexists(path):
        descriptor = os.open(path, os.O_CREAT | os.O_WRONLY | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        os.fsync(descriptor)
        os.close(descriptor)
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    os.fsync(folder)
    os.close(folder)
