"""Presses STOP on a page at each line of standard input; says when each began and was confirmed.

``python -m kmpc_lab.attacks.finger LINK SOCKET``; when the robot stands it lets the robot
drive again.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from firmware_bridge.safety.estop_client import NoBridge, ask
from kmpc_lab.attacks.page_line import PageLine

REST, PAUSE = 1.5, 0.2
"""While the rover comes to a stop, and between two words to the bridge [s]."""


def main(link: str, path: str) -> None:
    """Serve one rover until standard input ends."""
    page = PageLine(link)
    page.keep()
    _say("ready")
    for _ in sys.stdin:
        began = time.monotonic()
        if not page.stop():
            raise SystemExit("the page does not confirm that the robot stands")
        _say(f"{began} {time.monotonic()}")
        time.sleep(REST)
        for word in ("reset", "enable"):
            try:
                ask(Path(path), word)
            except NoBridge:  # that was the last press
                return
            time.sleep(PAUSE)


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
