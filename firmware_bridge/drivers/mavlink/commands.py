"""Commands sent until they are acknowledged, and the telemetry that is requested with them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED, FAILED, IN_PROGRESS = range(6)
"""MAV_RESULT; an ArduPilot that cannot arm yet answers FAILED."""
SET_MODE, ARM, REQUEST_MESSAGE, SET_MESSAGE_INTERVAL = 176, 400, 512, 511
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

    An acknowledgement names only the command; so it names the request, too.

    Parameters
    ----------
    send : SendCommand
        Writes one COMMAND_LONG.
    """

    def __init__(self, send: SendCommand) -> None:
        self._send = send
        self._requests: dict[int, _Request] = {}

    def request(self, command: int, *parameters: float, now: float, patient: bool = False) -> None:
        """Ask now, in place of an earlier request of this command.

        A patient request is repeated while it is refused for now, and after it was accepted until
        it is cancelled: what the vehicle says it did and what its heartbeat shows may differ.
        """
        self._requests[command] = _Request(tuple(parameters), patient, now)
        self.tick(now)

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
        """Take an acknowledgement; False where nothing like it was asked."""
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


@dataclass
class Stream:
    """One kind of telemetry."""

    message: int
    """Its message id."""
    name: str
    rates: tuple[float, ...]
    """Rates to ask for, the next where one is refused [Hz]."""
    needed: bool = True
    level: int = 0
    seen: float = -float("inf")
    asked: float = -float("inf")
    answered: bool = False
    refused: bool = False
    """Whether the vehicle gives it at no rate."""

    @property
    def rate(self) -> float:
        """Rate that is asked for [Hz]."""
        return self.rates[self.level]


@dataclass
class StreamRequests:
    """Requests telemetry kind by kind: less where it is denied, again where it stops."""

    desk: CommandDesk
    streams: tuple[Stream, ...]
    patience: float = 1.5
    """How long a stream may be silent, after it was asked for or last seen [s]."""
    _current: Stream | None = field(default=None, init=False)

    def saw(self, message: int, now: float) -> None:
        """Note that a message of this id came."""
        for stream in self.streams:
            if stream.message == message:
                stream.seen = now

    @property
    def answered(self) -> bool:
        """Whether the vehicle has answered every request at least once."""
        return all(stream.answered for stream in self.streams)

    def refused(self) -> tuple[str, ...]:
        """Names of what is needed and not given."""
        return tuple(stream.name for stream in self.streams if stream.needed and stream.refused)

    def tick(self, now: float) -> None:
        """Take the answer to the last request; ask the next that is silent."""
        if self._current is not None:
            result = self.desk.result(SET_MESSAGE_INTERVAL)
            if result is None:
                return
            self._settle(self._current, result)
            self.desk.cancel(SET_MESSAGE_INTERVAL)
            self._current = None
        silent = [
            s for s in self.streams if now - max(s.seen, s.asked) > self.patience or not s.answered
        ]
        if silent:
            stream = self._current = min(silent, key=lambda s: s.asked)
            stream.asked = now
            self.desk.request(
                SET_MESSAGE_INTERVAL, stream.message, round(1e6 / stream.rate), now=now
            )

    def _settle(self, stream: Stream, result: int) -> None:
        if result == ACCEPTED:
            stream.answered, stream.refused = True, False
        elif stream.level + 1 < len(stream.rates):
            stream.level += 1
        else:
            stream.answered = stream.refused = True


def rates_from(rate: float) -> tuple[float, ...]:
    """Rates to try, from `rate` down [Hz].

    ArduPilot gives at most 0.8 of its loop rate: 40 of 50 Hz.

    Examples
    --------
    >>> rates_from(50.0)
    (50.0, 40.0, 25.0, 20.0, 10.0, 5.0)
    """
    return (rate, *(lower for lower in (40.0, 25.0, 20.0, 10.0, 5.0) if lower < rate))
