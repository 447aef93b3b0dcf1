"""The latched emergency stop: requested over a local socket or by a signal, kept in a file.

The file outlives the process, so that a stop holds until it is reset. The socket is one bridge's:
taken under a lock, and removed only by the bridge that made it.
"""

from __future__ import annotations

import fcntl
import json
import os
import selectors
import socket
import stat
import struct
import threading
import time
from collections import deque
from dataclasses import dataclass
from pathlib import Path

from firmware_bridge.link.threaded import Ration
from firmware_bridge.messages import ConfigError, LinkError
from firmware_bridge.safety.gate_table import GateState
from firmware_bridge.safety.places import is_latched, latch_file, link_here, set_latch

LONGEST_PATH = 107
BACKLOG = 128
PRESSED = "the emergency stop is pressed: kmpc estop --reset first"  # why `enable` is refused then
WORDS = ("stop", "reset", "enable", "confirm", "status")
POLL = 0.02  # how often the latch file is looked at [s]; a request on the socket is served at once
CLIENT_PATIENCE = 1.0  # how long a client may take for its request [s]; it delays no other client
CONFIRM_PATIENCE = 0.4  # how long the answer to a request waits for the gate to obey [s]
LOOKS = 3  # so many ticks of the gate until what was asked for shows in what it tells
CLIENTS = 64  # one more connection than this closes the oldest: its client tries again
LONGEST_WORD = 64
ACCEPTED_AT_ONCE = 16


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


@dataclass
class Client:
    """A connected client."""

    peer: socket.socket
    until: float  # when the connection is closed, or its answer sent, at the latest [s]
    said: bytes = b""
    word: str | None = None  # what it asked for, once it has; nothing more is read from it then
    refusal: str = ""  # why that is refused, in words; else empty
    look: int = 0  # the gate's look in which what it asked for shows


class EmergencyStop:
    """Takes stop requests from a socket and from signals, and keeps a stop until it is reset.

    `path`: of the socket, made with mode 0600; the latch lies beside it as PATH.latched. A latch
    that another program writes is a stop like any other.
    """

    def __init__(self, path: Path) -> None:
        check_path(path)
        self.path, self.latch_path = path, latch_file(path)
        self._disk = self._astray = ""
        self._latched = is_latched(path)
        # a deque needs no lock, so a signal handler may append in the middle of `take`
        self._requests: deque[str] = deque()
        self._gate = GateState.IDLE
        self._why: tuple[str, ...] = ()
        self._barred = ""
        self._looks = 0
        self._quit = threading.Event()
        self._listener: Listener | None = None
        self._link: Path | None = None
        self._clients: list[Client] = []
        self._thread: threading.Thread | None = None

    @property
    def latched(self) -> bool:
        """Whether a stop was pressed and not reset, by this process or one before it."""
        return self._latched

    @property
    def problem(self) -> str:
        """Why `kmpc estop` or the disk cannot do its part; in memory a stop holds all the same."""
        return "; ".join(filter(None, (self._disk, self._astray)))

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

        `barred` tells why `enable` is refused, empty if it is not.
        """
        self._gate, self._why, self._barred = state, why, barred
        self._looks += 1

    def open(self) -> None:
        """Listen, in a thread.

        Raises ConfigError if a file lies there that is no socket. Raises LinkError if another
        bridge listens there, or the socket cannot be made.
        """
        self._listener = Listener(self.path)
        try:
            self._link = link_here(self.path)
        except (OSError, ConfigError) as error:
            self._astray = f"kmpc estop needs --socket {self.path}: {error}"
        self._thread = threading.Thread(target=self._serve, name="bridge-estop", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Listen no more; the latch stays. Idempotent."""
        self._quit.set()
        if self._thread is not None:
            self._thread.join()
        if self._link is not None:
            self._link.unlink(missing_ok=True)
        if self._listener is not None:
            self._listener.close()
            self._mind_latch()

    def _serve(self) -> None:
        """Hear all clients at once; none of them can keep another waiting."""
        assert self._listener is not None
        ration = Ration()
        with selectors.DefaultSelector() as selector:
            selector.register(self._listener.socket, selectors.EVENT_READ)
            while not self._quit.is_set():
                ration.begin()
                try:
                    self._turn(selector)
                except Exception as error:  # nothing that a client does may end this thread
                    self._astray = f"emergency stop: {type(error).__name__}: {error}"
                    self._quit.wait(POLL)
                ration.end(0)
                if rest := ration.rest():  # whoever connects without end must not hold up the gate
                    self._quit.wait(min(rest, POLL))
            for client in list(self._clients):
                self._drop(client, selector)

    def _turn(self, selector: selectors.BaseSelector) -> None:
        for key, _ in selector.select(POLL):
            if key.data is None:
                self._accept(selector)
            elif key.data in self._clients:  # not closed a moment ago
                self._hear(key.data, selector)
        self._settle(selector)
        self._mind_latch()

    def _accept(self, selector: selectors.BaseSelector) -> None:
        assert self._listener is not None
        for _ in range(ACCEPTED_AT_ONCE):
            try:
                peer, _ = self._listener.socket.accept()
            except OSError:  # no more, or gone again before it was taken
                return
            peer.setblocking(False)
            if not _may_ask(peer):
                peer.close()
                continue
            if len(self._clients) >= CLIENTS:
                self._drop(self._clients[0], selector)
            client = Client(peer, time.monotonic() + CLIENT_PATIENCE)
            self._clients.append(client)
            selector.register(peer, selectors.EVENT_READ, client)
            self._hear(client, selector)  # its word is mostly there already

    def _hear(self, client: Client, selector: selectors.BaseSelector) -> None:
        """Read a client's request: a word, ended by a line break, a hang-up, or its length."""
        try:
            part = client.peer.recv(LONGEST_WORD)
        except BlockingIOError:
            return
        except OSError:
            part = b""
        client.said += part
        word, ended, _ = client.said.partition(b"\n")
        if ended or not part or len(client.said) >= LONGEST_WORD:
            selector.unregister(client.peer)
            self._do(client, word.decode(errors="replace").strip())

    def _do(self, client: Client, word: str) -> None:
        """Do what a client asks for; `_settle` answers it."""
        client.word = word
        if word == "stop":
            self.press()
        elif word == "reset":
            self._reset()
        elif word == "enable" and (refusal := self._refusal):
            client.refusal = refusal
        elif word in ("confirm", "enable"):
            self._requests.append(word)
        asked = word != "status" and word in WORDS and not client.refusal
        client.look = self._looks + (LOOKS if asked and self._looks else 0)
        client.until = time.monotonic() + (CONFIRM_PATIENCE if asked else 0.0)

    @property
    def _refusal(self) -> str:
        """Why the robot may not be enabled, empty if it may."""
        return PRESSED if self._latched else self._barred

    def _reset(self) -> None:
        self._latched = False
        try:
            set_latch(self.path, False)
        except OSError as error:  # what cannot be removed still says "pressed"
            self._latched = True
            self._tell_disk(error)
        else:
            self._requests.append("reset")

    def _settle(self, selector: selectors.BaseSelector) -> None:
        """Answer clients whose request was carried out; drop those who sent none in time."""
        now = time.monotonic()
        for client in list(self._clients):
            if client.word is not None and (now >= client.until or self._is_done(client)):
                self._mind_latch()
                try:
                    client.peer.send(json.dumps(self._answer(client)).encode() + b"\n")
                except OSError:  # what it had to say was done; it will not hear the answer
                    pass
                self._drop(client, selector)
            elif now >= client.until:
                self._drop(client, selector)

    def _is_done(self, client: Client) -> bool:
        """Whether the gate has done what a client asked for."""
        if client.word == "stop":
            return self._gate is GateState.ESTOP
        return self._looks >= client.look

    def _answer(self, client: Client) -> dict[str, object]:
        word = client.word
        refusal = PRESSED if word == "enable" and self._latched else client.refusal
        return {
            "ok": word in WORDS and not refusal and not (word == "reset" and self._latched),
            "latched": self._latched,
            "gate": self._gate.name,
            "confirmed": self._gate is GateState.ESTOP,
            "why": [refusal] if refusal else list(self._why),
        }

    def _drop(self, client: Client, selector: selectors.BaseSelector) -> None:
        if client in self._clients:
            self._clients.remove(client)
            if client.word is None:
                selector.unregister(client.peer)
            client.peer.close()

    def _mind_latch(self) -> None:
        """Treat a latch of another program as a stop; write ours again if it was removed."""
        there = is_latched(self.path)
        if there and not self._latched:
            self.press()
        elif self._latched and not there:
            try:
                set_latch(self.path, True)
            except OSError as error:
                self._tell_disk(error)
        else:
            self._disk = ""

    def _tell_disk(self, error: OSError) -> None:
        self._disk = (
            f"{self.latch_path}: cannot keep the emergency stop on disk: {error.strerror or error}"
        )


def _may_ask(peer: socket.socket) -> bool:
    """Whether a client is root or our own user."""
    size = struct.calcsize("3i")
    try:
        credentials = peer.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size)
    except OSError:
        return False
    _, user, _ = struct.unpack("3i", credentials)
    return user in (0, os.geteuid())
