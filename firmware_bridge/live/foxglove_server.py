"""Shows a drive to Foxglove: ``python -m firmware_bridge.live.foxglove_server DESCRIPTOR``.

It reads what its parent pickles for it, and nothing else; whoever connects can read only.
"""

from __future__ import annotations

import json
import os
import pickle
import socket
import sys
import time
from collections.abc import Mapping
from typing import Any

from firmware_bridge.live.address import LOOPBACK
from firmware_bridge.live.channel import LONGEST
from firmware_bridge.recording.drive.encoder import DriveEncoder
from firmware_bridge.recording.drive.mcap_writer import Message
from firmware_bridge.recording.drive.schemas import TOPICS

KEPT = ("/map", "/path", "/obstacles", "/gate")
"""Topics on which messages are rare: repeated for watchers that come late, so often [s]: ..."""
AGAIN = 1.0
NICE = 5
"""The program that drives goes first."""
BACKLOG = 64
"""Messages that wait for a slow viewer at most: two seconds; the oldest is left out."""


class Topics:
    """The channels of Foxglove, and what was sent last on those where messages are rare."""

    def __init__(self) -> None:
        import foxglove

        self._channels = {
            topic.name: foxglove.Channel(
                topic.name, schema=_schema(topic.schema, topic.description), message_encoding="json"
            )
            for topic in TOPICS
        }
        self._kept: dict[str, Message] = {}
        self._told = time.monotonic()

    def tell(self, message: Message) -> None:
        """Show a message."""
        if message.topic in KEPT:
            self._kept[message.topic] = message
        data = json.dumps(message.content, allow_nan=False).encode()
        self._channels[message.topic].log(data, log_time=message.time)

    def tell_again(self) -> None:
        """Repeat what is rare for watchers that have come since."""
        if time.monotonic() - self._told >= AGAIN:
            self._told = time.monotonic()
            for message in list(self._kept.values()):
                self.tell(message)


def _schema(name: str, description: Mapping[str, Any]) -> Any:
    import foxglove

    return foxglove.Schema(name=name, encoding="jsonschema", data=json.dumps(description).encode())


def main(descriptor: int) -> None:
    """Serve until the program that drives ends."""
    import foxglove

    records = socket.socket(fileno=descriptor)
    records.settimeout(AGAIN)
    try:
        port, scenario, dt, offset = pickle.load(sys.stdin.buffer)
    except EOFError:  # nothing was driven
        return
    os.nice(NICE)
    encoder, topics = DriveEncoder(scenario, dt, {}, offset), Topics()
    server = foxglove.start_server(
        name=f"kmpc: {scenario.name}", host=LOOPBACK, port=port, message_backlog_size=BACKLOG
    )
    topics.tell(encoder.map_message(time.monotonic()))
    while True:
        try:
            data = records.recv(LONGEST)
        except TimeoutError:
            topics.tell_again()
            continue
        if not data:
            break
        for message in encoder.messages(pickle.loads(data)):
            topics.tell(message)
        topics.tell_again()
    server.stop()


if __name__ == "__main__":
    main(int(sys.argv[1]))
