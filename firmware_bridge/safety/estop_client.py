"""Presses an emergency stop from another process: writes the latch, then asks over the socket."""

from __future__ import annotations

import json
import socket
import time
from pathlib import Path
from typing import Any

from firmware_bridge.messages import LinkError
from firmware_bridge.safety.places import set_latch

PATIENCE = 2.0  # how long a bridge may take to answer, all attempts together [s]
ATTEMPT, PAUSE = 0.5, 0.02  # how long one attempt may take, and between two [s]


class NoBridge(LinkError):
    """Nobody listens at the socket."""


def press(path: Path, timeout: float = PATIENCE) -> dict[str, Any]:
    """Press the emergency stop of the bridge at `path`, and wait until its gate has obeyed.

    The latch is written first: whoever keeps the socket busy, the bridge sees that file.

    Raises LinkError if no bridge confirms it; the latch holds all the same if it could be written.
    """
    problem = ""
    try:
        set_latch(path, True)
    except OSError as error:
        problem = f"; the stop could not be kept on disk either: {error.strerror or error}"
    try:
        return ask(path, "stop", timeout)
    except LinkError as error:
        raise type(error)(f"{error}{problem}") from error


def ask(path: Path, word: str, timeout: float = PATIENCE) -> dict[str, Any]:
    """Send a request (estop.WORDS) to a running bridge until it answers; return the answer.

    Raises NoBridge if none is running. Raises LinkError if it does not answer within `timeout` [s],
    or something else than a bridge does.
    """
    until = time.monotonic() + timeout
    while True:
        try:
            answer = _attempt(path, word, min(ATTEMPT, max(PAUSE, until - time.monotonic())))
            break
        except (FileNotFoundError, ConnectionRefusedError) as error:
            raise NoBridge(f"{path}: no bridge is running there") from error
        except PermissionError as error:
            raise LinkError(f"{path}: no permission: it is another user's: use sudo") from error
        except (OSError, ValueError) as error:
            if time.monotonic() + PAUSE >= until:
                raise LinkError(f"{path}: no answer: {error}") from error
        time.sleep(PAUSE)
    if not isinstance(answer, dict):
        raise LinkError(f"{path}: no bridge: it answered {answer!r}")
    return answer


def _attempt(path: Path, word: str, timeout: float) -> Any:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
        client.settimeout(timeout)
        client.connect(str(path))
        client.sendall(word.encode() + b"\n")
        return json.loads(_line(client, timeout))


def _line(peer: socket.socket, patience: float) -> str:
    """One line, whole within `patience` [s]."""
    data, until = b"", time.monotonic() + patience
    while not data.endswith(b"\n") and len(data) < 65536:
        peer.settimeout(max(0.001, until - time.monotonic()))
        part = peer.recv(4096)
        if not part:
            break
        data += part
    return data.decode(errors="replace").strip()
