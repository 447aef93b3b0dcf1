"""Commands that are sent until they are acknowledged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS = range(6)
"""MAV_RESULT; an ArduPilot that cannot arm yet answers FAILED."""
SET_MODE, ARM, PREARM_CHECKS, SET_MESSAGE_INTERVAL = 176, 400, 401, 511
"""MAV_CMD"""
SILENCE = 0.3
"""An acknowledgement that has not come after this long is lost: the command is sent again [s]."""
REFUSED = 1.0
"""How long to wait before asking again what was refused for now [s]."""
SendCommand = Callable[[int, Sequence[float], int], None]
"""Puts a COMMAND_LONG on the wire: command, parameters, confirmation."""


@dataclass
class _Request:
    """One command on its way."""

    parameters: tuple[float, ...]
    patient: bool
    due: float
    sent: int = 0
    result: int | None = None


class CommandDesk:
    """Sends one request per command at a time, until it is acknowledged.

    An acknowledgement names only the command, hence one request per command.

    `send`: writes one COMMAND_LONG.
    """

    def __init__(self, send: SendCommand) -> None:
        self._send = send
        self._requests: dict[int, _Request] = {}

    def request(self, command: int, *parameters: float, now: float, patient: bool = False) -> None:
        """Send a request now; it replaces an earlier one of this command.

        A patient request is repeated while it is refused for now, and after it was accepted until
        it is cancelled: what the vehicle says it did and what its heartbeat shows may differ.
        """
        self._requests[command] = _Request(tuple(parameters), patient, now)
        self.tick(now)

    def say(self, command: int, *parameters: float) -> None:
        """Send a command once, without waiting for an acknowledgement."""
        self._send(command, tuple(parameters), 0)

    def cancel(self, command: int) -> None:
        """Forget a request."""
        self._requests.pop(command, None)

    def result(self, command: int) -> int | None:
        """Last answer to the present request, None if there is none."""
        request = self._requests.get(command)
        return None if request is None else request.result

    def tick(self, now: float) -> None:
        """Send what is due."""
        for command, request in self._requests.items():
            if now >= request.due:
                self._send(command, request.parameters, min(request.sent, 255))
                request.sent += 1
                request.due = now + SILENCE

    def on_ack(self, command: int, result: int, now: float) -> bool:
        """Take an acknowledgement; False if no such command was requested."""
        request = self._requests.get(command)
        if request is None or not request.sent:
            return False
        if result == IN_PROGRESS:
            request.due = now + REFUSED
            return True
        request.result = result
        again = request.patient and result in (ACCEPTED, TEMPORARILY_REJECTED, FAILED)
        request.due = now + REFUSED if again else float("inf")
        return True
