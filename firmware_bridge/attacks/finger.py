"""Presses STOP on a page at each line of standard input; says when each began and was confirmed.

``python -m firmware_bridge.attacks.finger LINK SOCKET``; when the robot stands it lets the robot
drive again.
"""

from __future__ import annotations

import sys
import time
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

from firmware_bridge.safety.estop_client import NoBridge, ask

PATIENCE = 3.0
"""For each answer [s]."""
REST, PAUSE = 1.5, 0.2
"""While the rover comes to a stop, and between two words to the bridge [s]."""


def main(link: str, path: str) -> None:
    """Serve one rover until standard input ends."""
    _say("ready")
    url = urlsplit(link)
    for _ in sys.stdin:
        began, told = time.monotonic(), b""
        while b'"confirmed": true' not in told:
            connection = HTTPConnection("127.0.0.1", int(url.port or 0), timeout=PATIENCE)
            connection.request("POST", f"{url.path}stop")
            told = connection.getresponse().read()
            connection.close()
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
