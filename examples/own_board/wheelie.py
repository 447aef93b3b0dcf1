"""Driver of the Wheelie, a board that speaks in lines of text."""

from dataclasses import dataclass

from firmware_bridge.drivers.polled import LineDriver
from firmware_bridge.drivers.polled.options import PolledOptions, check_watchdog, counts_per_metre
from firmware_bridge.odometry import WheelOdometry
from firmware_bridge.options import bounded


@dataclass(frozen=True, kw_only=True)
class WheelieOptions(PolledOptions):
    """The [board] section of its robot file."""

    counts_per_turn: float = bounded(1.0, 1e7)
    watchdog: float = bounded(0.1, 10.0, "s", 0.3)

    def __post_init__(self):
        super().__post_init__()
        check_watchdog(self.command_timeout, self.watchdog)


class WheelieDriver(LineDriver):
    """Two motors with encoders."""

    board, options_type = "Wheelie", WheelieOptions

    def __init__(self, transport, geometry, options):
        counts_per_metre(geometry, options.counts_per_turn)  # refuses what 32 bits cannot hold
        odometry = WheelOdometry(geometry, options.counts_per_turn, wraps=False)
        super().__init__(transport, geometry, odometry, options)
        self._per_turn, self._watchdog = options.counts_per_turn, round(1000 * options.watchdog)

    def _configure(self):
        """Find the board, set its watchdog and check it, stop."""
        if self._request(f"W {self._watchdog}")[0] != [self._watchdog]:
            raise self._exchange.refuse("the watchdog was not taken")
        self._drive(0.0, 0.0)

    def _poll(self, cycle):
        """Ask for counters and speeds."""
        (left, right, *speeds), stamp = self._request("Q")
        self._moved((left, right), tuple(s / self._per_turn for s in speeds), stamp)

    def _drive(self, left, right):
        """Command the motors, in turns a second."""
        self._request(f"M {round(left * self._per_turn)} {round(right * self._per_turn)}")

    def _request(self, text):
        """Ask, and wait: numbers of the answer, and when they were true."""
        reply, stamp = self._exchange.ask(f"{text}\n".encode(), key=text[0])
        return [int(word) for word in reply.split()], stamp

    def _take_line(self, line, stamp):
        """Take a line: whether it makes sense. An answer repeats the letter of its question."""
        kind, *words = line.decode("ascii", "replace").split() or "?"
        if kind not in "WMQ" or len(words) != {"W": 1, "M": 2, "Q": 4}[kind]:
            return False
        if not all(word.removeprefix("-").isdigit() for word in words):
            return False
        self._exchange.deliver(kind, " ".join(words).encode(), stamp)
        return True
