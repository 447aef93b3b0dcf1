"""Serial ports and pseudo-terminals: raw 8N1, exclusive, opened by path."""

from __future__ import annotations

import errno
import fcntl
import glob
import grp
import os
import struct
import termios

from firmware_bridge.link.threaded import Endpoint, Port
from firmware_bridge.messages import ConfigError, LinkError

SPEEDS = {
    rate: getattr(termios, f"B{rate}")
    for rate in (9600, 19200, 38400, 57600, 115200, 230400, 460800, 500000, 576000, 921600)
}
DTR = struct.pack("I", termios.TIOCM_DTR)
READ_BYTES = 1024
"""Read at once: little, so that whoever takes it in is soon done."""


def make_raw(fd: int, baud: int | None) -> None:
    """Set a terminal to raw 8N1 without flow control; baud None leaves the speed."""
    _, _, _, _, ispeed, ospeed, control = termios.tcgetattr(fd)
    if baud is not None:
        ispeed = ospeed = SPEEDS[baud]
    control[termios.VMIN], control[termios.VTIME] = (
        1,
        0,
    )  # so that an empty read means hang-up, not "nothing yet"
    # Without HUPCL: closing does not drop DTR, which resets boards that have it on their reset
    # line.
    termios.tcsetattr(
        fd,
        termios.TCSANOW,
        [0, 0, termios.CS8 | termios.CREAD | termios.CLOCAL, 0, ispeed, ospeed, control],
    )


def set_dtr(fd: int, on: bool) -> None:
    """Set the line DTR of a serial port."""
    fcntl.ioctl(fd, termios.TIOCMBIS if on else termios.TIOCMBIC, DTR)


def explain(path: str, error: OSError) -> str:
    """Say why a port cannot be opened, and what to do."""
    if error.errno in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        seen = sorted(
            glob.glob("/dev/serial/by-id/*") + glob.glob("/dev/ttyACM*") + glob.glob("/dev/ttyUSB*")
        )
        return (
            f"{path}: no such port: is the cable in and the board powered? ports here: "
            f"{', '.join(seen) or 'none'}"
        )
    if error.errno in (errno.EACCES, errno.EPERM):
        try:
            group = grp.getgrgid(os.stat(path).st_gid).gr_name
        except (OSError, KeyError):
            group = "dialout"
        return f"{path}: no permission: run 'sudo usermod -aG {group} $USER' and log in again"
    if error.errno in (errno.EBUSY, errno.EWOULDBLOCK):
        return (
            f"{path}: in use by another program: stop the other bridge, "
            "ground station or ModemManager"
        )
    if error.errno in (errno.ENOTTY, errno.EISDIR, errno.EINVAL):
        return f"{path}: not a serial port"
    return f"{path}: {error.strerror or error}"


class TtyPort:
    """An open terminal."""

    def __init__(
        self, path: str, baud: int | None, exclusive: bool, dtr: bool | None = None
    ) -> None:
        self._path, self._dtr = path, dtr
        self._fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            if not os.isatty(self._fd):
                raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
            fcntl.flock(
                self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB
            )  # first: a port in use by another program keeps its settings
            if exclusive:
                fcntl.ioctl(self._fd, termios.TIOCEXCL)
            make_raw(self._fd, baud)
            termios.tcflush(self._fd, termios.TCIOFLUSH)
            if dtr is not None:
                set_dtr(self._fd, dtr)
        except (OSError, termios.error) as error:
            os.close(self._fd)
            raise OSError(*error.args) from error

    def fileno(self) -> int:
        """Descriptor to poll."""
        return self._fd

    def read(self) -> bytes:
        """Take what has arrived."""
        try:
            data = os.read(self._fd, READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise LinkError(f"{self._path}: lost: unplugged? ({error.strerror})") from error
        if not data:
            raise LinkError(f"{self._path}: lost: unplugged?")
        return data

    def write(self, data: memoryview) -> int:
        """Bytes that the port took."""
        try:
            return os.write(self._fd, data)
        except BlockingIOError:
            return 0
        except OSError as error:
            raise LinkError(f"{self._path}: lost: unplugged? ({error.strerror})") from error

    def close(self) -> None:
        """Close the descriptor, which gives the lock back too."""
        try:
            if self._dtr is not None:
                set_dtr(self._fd, not self._dtr)
        except OSError:
            pass  # it is unplugged: there is no line to set
        os.close(self._fd)


class TtyEndpoint(Endpoint):
    """A port by its path, so that /dev/serial/by-id/... finds a board again after a replug.

    Parameters
    ----------
    path : str
        Of the device or of a link to it.
    baud : int or None
        Bits per second; None leaves what the terminal has (pseudo-terminals have no wire).
    exclusive : bool
        Forbid other programs to open it, as well as locking it. Not for pseudo-terminals: there the
        mark would outlive a process that dies.
    dtr : bool or None
        What the line DTR is while the port is open; the opposite when it is closed. None leaves it
        as the system sets it.
    """

    def __init__(
        self, path: str, baud: int | None, exclusive: bool, dtr: bool | None = None
    ) -> None:
        if baud is not None and baud not in SPEEDS:
            raise ConfigError(f"baud: expected one of {', '.join(map(str, SPEEDS))}, got {baud}")
        self._path, self._baud, self._exclusive, self._dtr = path, baud, exclusive, dtr

    def open(self) -> Port:
        """Open, lock, set and flush the port."""
        try:
            return TtyPort(self._path, self._baud, self._exclusive, self._dtr)
        except OSError as error:
            raise LinkError(explain(self._path, error)) from error
