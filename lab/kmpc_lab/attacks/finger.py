"""Presses STOP on a page at each line of standard input, on the connection that a page keeps.

``python -m kmpc_lab.attacks.finger LINK SOCKET`` says when each press began and was confirmed; when
the robot stands it lets the robot drive again.
"""

from __future__ import annotations

import sys
import time
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from urllib.parse import urlsplit

from firmware_bridge.safety.estop_client import NoBridge, ask

HOST = "127.0.0.1"
PATIENCE = 3.0
"""For each answer [s]."""
TRIES, AGAIN = 20, 0.05
"""How often STOP is pressed at most, and the time in between [s]."""


class PageLine:
    """Posts what a page posts, on one connection for as long as that lives.

    Parameters
    ----------
    link : str
        Of the page, with its key.
    """

    def __init__(self, link: str) -> None:
        url = urlsplit(link)
        self._path = url.path
        self._connection = HTTPConnection(HOST, int(url.port or 0), timeout=PATIENCE)

    def post(self, word: str) -> bytes:
        """Give the answer to a word, empty if none came."""
        try:
            self._connection.request("POST", f"{self._path}{word}")
            return self._connection.getresponse().read()
        except (OSError, HTTPException):
            self._connection.close()  # the next one opens another
            return b""

    def keep(self) -> None:
        """Keep the connection open, as a page does that nobody presses."""
        self.post("line")

    def stop(self) -> bool:
        """Press STOP until the bridge has confirmed it, as a page does; False: it never did."""
        for _ in range(TRIES):
            if b'"confirmed": true' in self.post("stop"):
                return True
            time.sleep(AGAIN)
        return False


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
