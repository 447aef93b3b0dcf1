"""What browsers that watch cost the gate: the same drive with and without them, in turns."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any

from firmware_bridge.runtime.session import Session
from firmware_bridge.runtime.timing import Histogram
from firmware_bridge.safety.gate_table import GateState
from kmpc_lab.attacks.trial import attacker, input_of, tell

WINDOW, SETTLE = 2.0, 0.7
"""How long each turn lasts, and from its beginning until it counts [s]."""
WARM = 1.0
"""How long the robot drives before the first turn [s]."""
PATIENCE = 60.0
"""For the robot to drive [s]."""
TIMES = ("gate period, late by", "command spacing, off by")


class Turns:
    """Measures a session in turns: with watchers, without them.

    Parameters
    ----------
    clients : int
        Browsers, of which one reads nothing.
    seconds : float
        For each of both [s].
    folder : Path
        For what attackers are given.
    """

    def __init__(self, clients: int, seconds: float, folder: Path) -> None:
        self._clients, self._folder = clients, folder
        self._count = max(1, round(seconds / WINDOW))
        self._rest = Histogram()
        self.late = {False: Histogram(), True: Histogram()}
        """Lateness of the gate's periods, by whether browsers watched."""
        self.spacing = {False: Histogram(), True: Histogram()}
        """And how far the spacing of commands was off."""

    @contextmanager
    def watch(
        self, session: Session, page: AbstractContextManager[None], link: str
    ) -> Iterator[None]:
        """Measure while the context lasts; the drive ends when that is done.

        Parameters
        ----------
        session : Session
            What drives.
        page : context manager
            Shows the session on a live page while it lasts.
        link : str
            Of that page.
        """
        with ExitStack() as stack:
            stack.enter_context(page)
            child = attacker(self._folder, "watchers", (link, str(self._clients)), b"-")
            pipe = input_of(stack.enter_context(child))
            thread = threading.Thread(target=self._run, args=(session, pipe), daemon=True)
            thread.start()
            yield
            thread.join()

    def table(self) -> list[dict[str, Any]]:
        """Rows for people and machines [ms]; the ratio is that of the 99th percentiles."""
        rows = []
        for name, found in zip(TIMES, (self.late, self.spacing), strict=True):
            without, with_them = found[False].summary(), found[True].summary()
            before, after = without["p99"], with_them["p99"]
            ratio = round(after / before, 3) if before and after else None
            rows.append({"time": name, "without": without, "with": with_them, "ratio": ratio})
        return rows

    def _run(self, session: Session, pipe: IO[str]) -> None:
        loop = session.loop
        until = time.monotonic() + PATIENCE
        while loop.gate.state is not GateState.ACTIVE and time.monotonic() < until:
            time.sleep(0.05)
        time.sleep(WARM)
        for turn in range(2 * self._count):
            watched = bool(turn % 2)
            tell([pipe], "on" if watched else "off")
            self._count_in(session, self._rest, self._rest)
            time.sleep(SETTLE)
            self._count_in(session, self.late[watched], self.spacing[watched])
            time.sleep(WINDOW)
        self._count_in(session, self._rest, self._rest)
        loop.request_stop("measured")

    def _count_in(self, session: Session, late: Histogram, spacing: Histogram) -> None:
        """Count times in other histograms from now on: the loop takes what is there."""
        session.loop.statistics.late = late
        session.loop.statistics.spacing_error = spacing


def told(rows: list[dict[str, Any]], clients: int) -> str:
    """Put a table into words."""
    lines = []
    for row in rows:
        for which in ("without", "with"):
            times = ", ".join(f"{key} {row[which][key]} ms" for key in ("p50", "p99", "max"))
            lines.append(f"{row['time']}, {which} {clients} browsers: {times}")
        lines.append(f"   p99 with / without: {row['ratio']}")
    return "\n".join(lines)
