"""Where bridges listen for an emergency stop, how one finds them all, and the latch beside each.

A shell, a service and sudo have different runtime folders; `kmpc estop` looks in all of them.
A bridge that listens elsewhere leaves a link to its socket in its own folder. The latch is a file
whose presence means "pressed", whoever made it.
"""

from __future__ import annotations

import os
import stat
import tempfile
from pathlib import Path

from firmware_bridge.messages import ConfigError

NAME, NAMES = "kmpc-bridge.sock", "kmpc-bridge*.sock"
SERVICES, USERS = Path("/run/kmpc-bridge"), Path("/run/user")
"""Runtime folders of the service (RuntimeDirectory=kmpc-bridge), and of the sessions."""


def default_socket() -> Path:
    """Where this user's bridge listens.

    In $RUNTIME_DIRECTORY (systemd), $XDG_RUNTIME_DIR, or a private folder for temporary files.
    """
    for name in ("RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"):
        folder = os.environ.get(name, "").partition(":")[0]
        if folder and os.path.isdir(folder):
            return Path(folder) / NAME
    private = _private(os.geteuid())
    private.mkdir(mode=0o700, exist_ok=True)
    if not _is_private(private, os.geteuid()):
        raise ConfigError(
            f"{private}: expected a folder of your own with mode 0700: remove it, "
            "or give --socket PATH"
        )
    return private / NAME


def likely_sockets() -> list[Path]:
    """Where a bridge of this user, of the user behind sudo, or of the service would listen.

    This user's own place comes first.
    """
    users = [os.geteuid()]
    behind = os.environ.get("SUDO_UID", "")
    if os.geteuid() == 0 and behind.isascii() and behind.isdigit():
        users.append(int(behind))
    private = [folder for user in users if _is_private(folder := _private(user), user)]
    folders = [SERVICES, *(USERS / str(user) for user in users), *private]
    there = [folder / NAME for folder in folders if folder.is_dir()]
    try:
        there.insert(0, default_socket())
    except ConfigError:  # a planted folder must not hide the bridges elsewhere
        if not there:
            raise
    return list(dict.fromkeys(there))


def found_sockets() -> list[Path]:
    """Sockets that lie in the likely places, those behind links included; each once."""
    found: dict[tuple[int, int], Path] = {}
    for likely in likely_sockets():
        for path in sorted(likely.parent.glob(NAMES)):
            try:
                status = path.stat()
            except OSError:  # a link to a bridge that is gone, or a folder of another user
                continue
            if stat.S_ISSOCK(status.st_mode):
                found.setdefault((status.st_dev, status.st_ino), path.resolve())
    return list(found.values())


def link_here(path: Path) -> Path | None:
    """Leave a link to a socket where `found_sockets` looks, if it lies elsewhere."""
    usual = default_socket()
    if path.resolve() == usual.resolve():
        return None
    link = usual.with_name(f"kmpc-bridge-{os.getpid()}.sock")
    link.unlink(missing_ok=True)
    link.symlink_to(path.resolve())
    return link


def _private(user: int) -> Path:
    return Path(tempfile.gettempdir()) / f"kmpc-bridge-{user}"


def _is_private(folder: Path, user: int) -> bool:
    """Whether a folder is a user's own, and closed to others."""
    try:
        status = folder.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(status.st_mode) and status.st_uid == user and not status.st_mode & 0o077


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
