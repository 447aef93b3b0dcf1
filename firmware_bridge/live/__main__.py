"""Serves the page of a simulated drive: ``python -m firmware_bridge.live DESCRIPTOR``."""

import sys
from collections.abc import Callable
from typing import Any

from firmware_bridge.live.channel import Channel
from firmware_bridge.live.picture import Picture
from firmware_bridge.live.server import Ask, serve

OBEYED: dict[str, Callable[[dict[str, Any]], bool]] = {
    "status": lambda shown: True,
    "stop": lambda shown: bool(shown.get("latched")),
    "reset": lambda shown: not shown.get("latched"),
    "enable": lambda shown: shown.get("gate") == "ACTIVE",
}
"""What is shown once a word was carried out."""


def ask_the_drive(channel: Channel, picture: Picture, settings: dict[str, Any]) -> Ask:
    """Make the way by which a button reaches a simulated drive: the channel."""

    def ask(word: str) -> dict[str, Any]:
        if word != "status":
            channel.send({"word": word})
        ok = picture.wait_until(OBEYED[word])
        shown = picture.values
        latched = bool(shown.get("latched"))
        gate = shown.get("gate")
        return {"ok": ok, "latched": latched, "gate": gate, "confirmed": latched, "why": []}

    return ask


if __name__ == "__main__":
    serve(int(sys.argv[1]), ask_the_drive)
