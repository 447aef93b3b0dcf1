"""Serves the page of a bridge: ``python -m firmware_bridge.live.page DESCRIPTOR``.

Its STOP takes the way of `kmpc estop`: the latch on disk first, then the bridge's own socket. It is
another process than the bridge's: whatever browsers do, the gate keeps its pace.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from firmware_bridge.live.channel import Channel
from firmware_bridge.live.picture import Picture
from firmware_bridge.live.server import GOAL, Ask, serve
from firmware_bridge.messages import LinkError
from firmware_bridge.safety.estop_client import ask, press
from firmware_bridge.safety.places import is_latched


def ask_the_bridge(channel: Channel, picture: Picture, settings: dict[str, Any]) -> Ask:
    """Make the way by which a button reaches the bridge: the socket of its emergency stop.

    A goal goes through the channel.
    """
    path = Path(settings["socket"])

    def drive_to(goal: str) -> dict[str, Any]:
        channel.send({"word": goal})
        ok = picture.wait_until(lambda shown: shown.get("heard", ("", ""))[0] == goal)
        refused = picture.values["heard"][1] if ok else "the bridge did not answer"
        return {"ok": not refused, "why": [refused] if refused else []}

    def carry_out(word: str) -> dict[str, Any]:
        if word.startswith(GOAL):
            return drive_to(word)
        try:
            return press(path) if word == "stop" else ask(path, word)
        except LinkError as error:
            holds = is_latched(path)
            more = "; the stop is pressed all the same: it holds once a bridge sees it"
            return {
                "ok": False,
                "latched": holds,
                "gate": None,
                "confirmed": False,
                "why": [f"{error}{more if holds else ''}"],
            }

    return carry_out


if __name__ == "__main__":
    serve(int(sys.argv[1]), ask_the_bridge)
