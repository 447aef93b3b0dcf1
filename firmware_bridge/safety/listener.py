"""One socket for one bridge: taken under a lock, and removed only by the bridge that made it."""

from __future__ import annotations

import fcntl
import os
import socket
import stat
from pathlib import Path

from firmware_bridge.messages import ConfigError, LinkError

LONGEST_PATH = 107
BACKLOG = 128


def check_path(path: Path) -> None:
    """Refuse a path that no socket can have."""
    if len(os.fsencode(path)) > LONGEST_PATH:
        raise ConfigError(f"socket: expected a path of at most {LONGEST_PATH} bytes, got {path}")


class Listener:
    """A listening socket that no second bridge can take over while this one lives.

    `path`: of the socket, made with mode 0600; a lock file lies beside it as PATH.lock. Raises
    ConfigError if something else than a socket lies there: it is left alone. Raises LinkError if
    another bridge, or another program, listens there, or the socket cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._lock_path = path, path.with_name(path.name + ".lock")
        self._lock = self._take_lock()
        try:
            self._make_room()
            self.socket = self._bind()
        except BaseException:
            self._give_lock()
            raise
        self._made = _inode(path)

    def close(self) -> None:
        """Stop listening; a socket that another program has put at the path stays. Idempotent."""
        if self._lock < 0:
            return
        self.socket.close()
        if self._made is not None and _inode(self._path) == self._made:
            self._path.unlink(missing_ok=True)
        self._give_lock()

    def _take_lock(self) -> int:
        while True:
            try:
                lock = os.open(
                    self._lock_path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600
                )
            except OSError as error:
                raise self._cannot(error) from error
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError as error:
                os.close(lock)
                raise self._taken() from error
            status = os.fstat(lock)
            if _inode(self._lock_path) == (status.st_dev, status.st_ino):
                return lock
            os.close(lock)  # its owner removed it while we waited for it: take the next

    def _give_lock(self) -> None:
        lock, self._lock = self._lock, -1
        self._lock_path.unlink(missing_ok=True)
        os.close(lock)

    def _make_room(self) -> None:
        """Remove a socket without a listener: its bridge was killed."""
        try:
            mode = self._path.lstat().st_mode
        except OSError:
            return  # nothing is there, or binding will show it
        if not stat.S_ISSOCK(mode):
            raise ConfigError(
                f"{self._path}: expected a socket or nothing, got another file, which is left "
                "alone: give another --socket PATH"
            )
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
            probe.setblocking(False)
            try:
                probe.connect(str(self._path))
            except ConnectionRefusedError:
                self._path.unlink(missing_ok=True)
                return
            except OSError as error:  # busy, or not accessible: a bridge is there
                raise self._taken() from error
        raise self._taken()

    def _bind(self) -> socket.socket:
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        mask = os.umask(0o177)
        try:
            listener.bind(str(self._path))
            listener.listen(BACKLOG)
        except OSError as error:
            listener.close()
            raise self._cannot(error) from error
        finally:
            os.umask(mask)
        listener.setblocking(False)
        return listener

    def _taken(self) -> LinkError:
        return LinkError(
            f"{self._path}: another bridge is running: one robot has one; stop it, "
            "or give --socket PATH for another robot"
        )

    def _cannot(self, error: OSError) -> LinkError:
        return LinkError(f"{self._path}: cannot listen: {error.strerror or error}")


def _inode(path: Path) -> tuple[int, int] | None:
    """Identity of the file at a path; None if there is none."""
    try:
        status = path.lstat()
    except OSError:
        return None
    return status.st_dev, status.st_ino
