"""ArduPilot's GCS failsafe, the vehicle's own watchdog on the bridge.

It is off by default, and watches the heartbeats of one system id only.
"""

from __future__ import annotations

from collections.abc import Callable

ENABLE, WATCHED = "FS_GCS_ENABLE", "SYSID_MYGCS"
PERIOD, TRIES = 1.0, 5
"""Time between requests [s], and the largest number of them."""


class GcsFailsafe:
    """Reads the two parameters and turns the failsafe on.

    `read`: sends PARAM_REQUEST_READ for a name. `write`: sends PARAM_SET: name, value, type.
    `own_system`: our system id. `wanted`: whether to turn it on, or only to look.
    """

    def __init__(
        self,
        read: Callable[[str], None],
        write: Callable[[str, float, int], None],
        own_system: int,
        wanted: bool,
    ) -> None:
        self._read, self._write = read, write
        self._own_system, self._wanted = own_system, wanted
        self._values: dict[str, tuple[float, int]] = {}
        self._due, self._tries = -float("inf"), 0

    def on_param(self, name: str, value: float, kind: int, now: float) -> None:
        """Take a PARAM_VALUE."""
        if name in (ENABLE, WATCHED):
            self._values[name] = (value, kind)
            if name == ENABLE and value == 0.0 and self._wanted:
                self._due = min(self._due, now)

    def tick(self, now: float) -> None:
        """Ask for what is missing."""
        if now < self._due or self._tries >= TRIES or self.settled:
            return
        self._due, self._tries = now + PERIOD, self._tries + 1
        for name in (ENABLE, WATCHED):
            if name not in self._values:
                self._read(name)
        enable = self._values.get(ENABLE)
        if enable is not None and enable[0] == 0.0 and self._wanted:
            self._write(ENABLE, 1.0, enable[1])

    @property
    def watched(self) -> int | None:
        """System id whose heartbeats it counts, None if that is not known."""
        return round(self._values[WATCHED][0]) if WATCHED in self._values else None

    @property
    def settled(self) -> bool:
        """Whether nothing is left to ask."""
        known = len(self._values) == 2
        return known and (not self._wanted or self._values[ENABLE][0] != 0.0)

    @property
    def note(self) -> str:
        """Whether the vehicle watches our heartbeats, in words."""
        if ENABLE not in self._values or WATCHED not in self._values:
            return f"GCS failsafe: {ENABLE} and {WATCHED} not read" + (
                ": no answer" if self._tries >= TRIES else " yet"
            )
        if self._values[ENABLE][0] == 0.0:
            return (
                f"GCS failsafe: off ({ENABLE} 0): if this computer dies, "
                "only the 3 s set-point time-out stops the rover"
            )
        watched = round(self._values[WATCHED][0])
        if watched != self._own_system:
            return (
                f"GCS failsafe: watches system {watched} ({WATCHED}), not us ({self._own_system})"
            )
        return "GCS failsafe: on, watches us"
