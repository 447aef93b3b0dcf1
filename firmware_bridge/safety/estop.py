"""The latched emergency stop: a local socket, a signal, and a file that outlives the process.

It stays until somebody resets it.
"""

from __future__ import annotations

import json
import os
import select
import socket
import stat
import struct
import tempfile
import threading
import time
from collections import deque
from pathlib import Path
from typing import Any

from firmware_bridge.messages import ConfigError, LinkError
from firmware_bridge.safety.gate_table import GateState

WORDS = ("stop", "reset", "enable", "confirm", "status")
POLL = 0.1
"""How often the latch file is brought up to date [s]; a request on the socket is served at once."""
CLIENT_PATIENCE = 0.2
"""How long a client may take to say its word [s]."""
LONGEST_PATH = 107


def default_socket() -> Path:
    """Where this user's bridge listens.

    In $RUNTIME_DIRECTORY (systemd), $XDG_RUNTIME_DIR, or a private folder for temporary files.
    """
    for name in ("RUNTIME_DIRECTORY", "XDG_RUNTIME_DIR"):
        folder = os.environ.get(name, "").partition(":")[0]
        if folder and os.path.isdir(folder):
            return Path(folder) / "kmpc-bridge.sock"
    private = Path(tempfile.gettempdir()) / f"kmpc-bridge-{os.geteuid()}"
    private.mkdir(mode=0o700, exist_ok=True)
    found = private.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.geteuid() or found.st_mode & 0o077:
        raise ConfigError(
            f"{private}: expected a folder of your own with mode 0700: remove it, "
            "or give --socket PATH"
        )
    return private / "kmpc-bridge.sock"


class EmergencyStop:
    """Takes stop requests from a socket and from signals, and keeps a stop until it is reset.

    Parameters
    ----------
    path : Path
        Of the socket, made with mode 0600; the latch lies beside it as PATH.latched.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.latch_path = path, latch_file(path)
        if len(os.fsencode(path)) > LONGEST_PATH:
            raise ConfigError(
                f"socket: expected a path of at most {LONGEST_PATH} bytes, got {path}"
            )
        self.problem = ""
        """Why the latch could not be kept on disk; in memory it holds all the same."""
        self._latched = self.latch_path.exists()
        # a deque needs no lock, so a signal handler may append in the middle of `take`
        self._requests: deque[str] = deque()
        self._gate = GateState.IDLE
        self._why: tuple[str, ...] = ()
        self._barred = ""
        self._confirmed = threading.Event()
        self._quit = threading.Event()
        self._socket: socket.socket | None = None
        self._thread: threading.Thread | None = None

    @property
    def latched(self) -> bool:
        """Whether a stop was pressed and not reset, by this process or one before it."""
        return self._latched

    def press(self) -> None:
        """Stop the robot; safe in a signal handler."""
        self._latched = True
        self._requests.append("stop")

    def take(self) -> set[str]:
        """Give the requests since the last call."""
        taken = set()
        while self._requests:
            taken.add(self._requests.popleft())
        return taken

    def tell(self, state: GateState, why: tuple[str, ...] = (), barred: str = "") -> None:
        """Learn what the gate is doing and what is wrong, for `status`.

        `barred` tells why `enable` is refused, empty where it is not.
        """
        self._gate, self._why, self._barred = state, why, barred
        if state is GateState.ESTOP:
            self._confirmed.set()
        else:
            self._confirmed.clear()

    def open(self) -> None:
        """Listen, in a thread.

        Raises
        ------
        LinkError
            Where another bridge listens there, or the socket cannot be made.
        """
        try:
            ask(self.path, "status")
        except LinkError:
            self.path.unlink(missing_ok=True)  # left behind by a bridge that was killed
        else:
            raise LinkError(
                f"{self.path}: another bridge is running: stop it, or give --socket PATH"
            )
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        mask = os.umask(0o177)
        try:
            listener.bind(str(self.path))
            os.chmod(self.path, 0o600)
            listener.listen(8)
        except OSError as error:
            listener.close()
            raise LinkError(f"{self.path}: cannot listen: {error.strerror or error}") from error
        finally:
            os.umask(mask)
        listener.setblocking(False)
        self._socket = listener
        self._thread = threading.Thread(target=self._serve, name="bridge-estop", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Listen no more; the latch stays. Idempotent."""
        self._quit.set()
        if self._thread is not None:
            self._thread.join()
        if self._socket is not None:
            self._socket.close()
            self._socket = None
            self.path.unlink(missing_ok=True)
        self._keep_latch()

    def _serve(self) -> None:
        assert self._socket is not None
        while not self._quit.is_set():
            if select.select([self._socket], [], [], POLL)[0]:
                try:
                    client, _ = self._socket.accept()
                except OSError:  # gone again before it was taken
                    continue
                with client:
                    self._answer(client)
            self._keep_latch()

    def _answer(self, client: socket.socket) -> None:
        """Serve one request: one word in a line, one JSON object back."""
        try:
            _, uid, _ = struct.unpack(
                "3i",
                client.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i")),
            )
            if uid not in (0, os.geteuid()):
                return
            word = _line(client, CLIENT_PATIENCE)
            known = word in WORDS
            if word == "stop":
                self.press()
                self._confirmed.wait(2 * CLIENT_PATIENCE)
            elif word == "reset":
                self._latched = False
                self._requests.append(word)
            elif word == "confirm" or (word == "enable" and not self._barred):
                self._requests.append(word)
            elif word == "enable":
                known = False
            self._keep_latch()
            reply = {
                "ok": known,
                "latched": self._latched,
                "gate": self._gate.name,
                "confirmed": self._confirmed.is_set(),
                "why": [self._barred] if word == "enable" and self._barred else list(self._why),
            }
            client.sendall(json.dumps(reply).encode() + b"\n")
        except OSError:  # whatever it had to say was done above; it will not hear the answer
            return

    def _keep_latch(self) -> None:
        """Bring the latch file into line with the latch."""
        if self._latched == self.latch_path.exists():
            return
        try:
            set_latch(self.path, self._latched)
            self.problem = ""
        except OSError as error:
            self.problem = (
                f"{self.latch_path}: cannot keep the emergency stop on disk: "
                f"{error.strerror or error}"
            )


def latch_file(socket_path: Path) -> Path:
    """Where the latch of a socket lies."""
    return socket_path.with_name(socket_path.name + ".latched")


def set_latch(socket_path: Path, latched: bool) -> None:
    """Write or remove the latch, down to the disk."""
    path = latch_file(socket_path)
    if latched:
        descriptor = os.open(path, os.O_CREAT | os.O_WRONLY, 0o600)
        os.fsync(descriptor)
        os.close(descriptor)
    else:
        path.unlink(missing_ok=True)
    folder = os.open(path.parent, os.O_RDONLY | os.O_DIRECTORY)
    os.fsync(folder)
    os.close(folder)


def ask(path: Path, word: str, timeout: float = 1.0) -> dict[str, Any]:
    """Send one of `WORDS` to a running bridge and give its answer.

    Raises
    ------
    LinkError
        Where none is running, or it does not answer within `timeout` [s].
    """
    until = time.monotonic() + timeout
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
            client.settimeout(timeout)
            client.connect(str(path))
            client.sendall(word.encode() + b"\n")
            answer = json.loads(_line(client, until - time.monotonic()))
    except (FileNotFoundError, ConnectionRefusedError) as error:
        raise LinkError(f"{path}: no bridge is running there") from error
    except (OSError, ValueError) as error:
        raise LinkError(f"{path}: no answer: {error}") from error
    if not isinstance(answer, dict):
        raise LinkError(f"{path}: no bridge: it answered {answer!r}")
    return answer


def _line(peer: socket.socket, patience: float) -> str:
    """One short line, whole within `patience` [s]."""
    data, until = b"", time.monotonic() + patience
    while not data.endswith(b"\n") and len(data) < 1024:
        peer.settimeout(max(0.001, until - time.monotonic()))
        part = peer.recv(1024)
        if not part:
            break
        data += part
    return data.decode(errors="replace").strip()
