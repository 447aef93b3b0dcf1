"""Serial ports and pseudo-terminals, by pyserial: raw 8N1 at any speed, exclusive, by path."""

from __future__ import annotations

import errno
import fcntl
import grp
import os
import termios
from collections.abc import Callable
from typing import Any

from serial import Serial, SerialException
from serial.tools import list_ports

from firmware_bridge.link.threaded import Endpoint, Port
from firmware_bridge.messages import LinkError

SLOWEST, FASTEST = 300, 12_000_000  # bits per second that a port may be asked for
OF_A_TERMINAL = 38400
"""Bits per second of a pseudo-terminal, which has no wire, as the system makes it."""
READ_BYTES = 1024  # read at once: little, so that whoever takes it in is soon done


def explain(path: str, error: OSError) -> str:
    """Say why a port cannot be opened, and what to do."""
    number = error.errno
    if number in (errno.ENOENT, errno.ENXIO, errno.ENODEV):
        seen = sorted(port.device for port in list_ports.comports(include_links=True))
        here = ", ".join(seen) or "none"
        return f"{path}: no such port: is the cable in and the board powered? ports here: {here}"
    if number in (errno.EACCES, errno.EPERM):
        try:
            group = grp.getgrgid(os.stat(path).st_gid).gr_name
        except (OSError, KeyError):
            group = "dialout"
        return f"{path}: no permission: run 'sudo usermod -aG {group} $USER' and log in again"
    if number in (errno.EBUSY, errno.EWOULDBLOCK):
        others = "the other bridge, ground station or ModemManager"
        return f"{path}: in use by another program: stop {others}"
    if number in (errno.ENOTTY, errno.EISDIR, errno.EINVAL, None):
        return f"{path}: not a serial port"
    return f"{path}: {os.strerror(number)}"


class SerialPort:
    """An open port.

    `path`: of the device or of a link to it. `baud`: bits per second. `exclusive`: forbid other
    programs to open it, as well as locking it. Not for pseudo-terminals: there the mark would
    outlive a process that dies. `dtr`: what the line DTR is while the port is open; the opposite
    when it is closed. None leaves it as the system sets it.
    """

    def __init__(
        self, path: str, baud: int, exclusive: bool = False, dtr: bool | None = None
    ) -> None:
        self._path, self._dtr = path, dtr
        self._port = Serial(None, baud, timeout=0, exclusive=True)
        self._port.port = path
        if dtr is not None:
            self._port.dtr = dtr
        self._port.open()
        try:
            if dtr is not None:  # again, for a port without such a line is passed over at first
                self._port.dtr = dtr
            if exclusive:
                fcntl.ioctl(self._port, termios.TIOCEXCL)
            *modes, control = termios.tcgetattr(self._port)
            control[termios.VMIN] = 1  # an empty read means hang-up, not "nothing yet"
            modes[2] &= ~termios.HUPCL  # closing drops no DTR, which resets some boards
            termios.tcsetattr(self._port, termios.TCSANOW, [*modes, control])
        except (OSError, termios.error) as error:
            self._port.close()
            raise OSError(*error.args) from error

    def fileno(self) -> int:
        """Descriptor to poll."""
        return int(self._port.fileno())

    def read(self) -> bytes:
        """Take what has arrived."""
        data: bytes = self._tried(os.read, READ_BYTES, b"")
        return data

    def write(self, data: memoryview) -> int:
        """Bytes that the port took."""
        taken: int = self._tried(os.write, data, 0)
        return taken

    def _tried(self, call: Callable[..., Any], argument: Any, nothing: Any) -> Any:
        """What a call gives, or nothing where it would wait; LinkError for a port that is gone."""
        try:
            if (found := call(self.fileno(), argument)) != b"":
                return found
            why = ""
        except BlockingIOError:
            return nothing
        except OSError as error:
            why = f" ({error.strerror})"
        raise LinkError(f"{self._path}: lost: unplugged?{why}")

    def close(self) -> None:
        """Close the descriptor, which gives the lock back too."""
        try:
            if self._dtr is not None:
                self._port.dtr = not self._dtr
        except OSError:
            pass  # it is unplugged: there is no line to set
        self._port.close()


class SerialEndpoint(Endpoint):
    """A port by its path, so that /dev/serial/by-id/... finds a board again after a replug.

    What it is made with is what `SerialPort` takes.
    """

    def __init__(self, path: str, *how: Any) -> None:
        self._path, self._how = path, how

    def open(self) -> Port:
        """Open, lock, set and flush the port."""
        try:
            if os.path.isfile(self._path):
                raise OSError(errno.ENOTTY, os.strerror(errno.ENOTTY))
            return SerialPort(self._path, *self._how)
        except (SerialException, OSError) as error:
            raise LinkError(explain(self._path, error)) from error
