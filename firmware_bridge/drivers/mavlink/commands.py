"""What the vehicle is asked, and when: commands that are sent until they are acknowledged.

Nothing may be asked of it before it accepts our frames. A signed link refuses every frame that is
older than the newest the vehicle has seen. Its clock runs up to a minute ahead of ours, so the
first frames of a new process are refused until we have heard its clock. Were GUIDED asked for
before one of our heartbeats was accepted, the failsafe that still waits for one would choose HOLD
at once.
"""

from __future__ import annotations

import math
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
EAGER, CALM = 0.1, 1.0
"""Between heartbeats, before and after one of them is known to be accepted [s]."""
SETTLE = 0.3
"""ArduPilot looks at its failsafes ten times a second: it has seen our heartbeat after this [s]."""
FORGET = 5.0
"""Without an answer for this long it is not known any more whether we are accepted [s]."""


class Due:
    """Remembers when each job is due next.

    Examples
    --------
    >>> due = Due()
    >>> due("heartbeat", 5.0, 1.0), due("heartbeat", 5.5, 1.0), due("heartbeat", 6.0, 1.0)
    (True, False, True)
    """

    def __init__(self) -> None:
        self._next: dict[str, float] = {}

    def __call__(self, what: str, now: float, period: float) -> bool:
        """Whether a job is due at `now` [s]; if so, it is due again `period` [s] later."""
        if now < self._next.get(what, -math.inf):
            return False
        self._next[what] = now + period
        return True


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


class Greeting:
    """Concludes from answers: a vehicle that answers a question accepts it, and all sent later."""

    def __init__(self) -> None:
        self._answered = -math.inf
        self._accepted: float | None = None
        """When the first heartbeat went out that must have been accepted [s]."""
        self._first: float | None = None

    @property
    def answered(self) -> bool:
        """Whether the vehicle has ever answered."""
        return math.isfinite(self._answered)

    def on_answer(self, now: float) -> None:
        """Note an answer to a question of ours."""
        if self._first is None or now - self._answered > FORGET:
            self._first, self._accepted = now, None
        self._answered = now

    def on_heartbeat_sent(self, now: float) -> None:
        """Note a heartbeat of ours."""
        if self._first is not None and self._accepted is None and now > self._first:
            self._accepted = now

    def done(self, now: float) -> bool:
        """Whether a heartbeat of ours was accepted, and the failsafe has had time to see it."""
        fresh = now - self._answered <= FORGET
        return fresh and self._accepted is not None and now - self._accepted >= SETTLE

    def period(self, now: float) -> float:
        """Time between heartbeats [s]."""
        return CALM if self.done(now) else EAGER
