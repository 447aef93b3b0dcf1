"""Starts the process that serves the page, and sends it what is new."""

from __future__ import annotations

import subprocess
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

from firmware_bridge.live.address import LiveAddress
from firmware_bridge.live.channel import Channel, Packet

PERIOD = 0.1  # between two packets [s]
PATIENCE = 2.0  # how long the page's process may take to say goodbye [s]
Source = Callable[[], Packet]
"""Gives what is true now, from references that whoever drives has left; it must not wait."""


class Feed:
    """A page of one drive, as a context.

    The port is taken at once, so that an unavailable address is reported before anything moves;
    the page is served from `__enter__` on.

    `address`: where. `module`: what the page's process runs; it is given the descriptor of a
    channel. `settings`: what that module needs besides. `on_word`: takes words that the page's
    process sends back. Raises LiveError if the address cannot be listened at.
    """

    def __init__(
        self,
        address: LiveAddress,
        module: str,
        settings: Mapping[str, Any] | None = None,
        on_word: Callable[[str], None] | None = None,
    ) -> None:
        self._doors = address.bind()
        self.links = address.links(self._doors[0].getsockname()[1])
        self._settings = {
            **(settings or {}),
            "token": address.token,
            "open": address.is_open,
            "names": address.names(),
            "doors": [door.fileno() for door in self._doors],
        }
        self._module, self._on_word = module, on_word
        self._quit = threading.Event()
        self._channel: Channel | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._thread: threading.Thread | None = None
        self._source: Source | None = None
        self._still: Packet = {}
        self.problem = ""  # why the page is served no more, in words; empty while it is

    def __enter__(self) -> Self:
        """Serve the page."""
        self._channel, theirs = Channel.pair()
        self._channel.send(self._settings)
        descriptors = [theirs.socket.fileno(), *(door.fileno() for door in self._doors)]
        # a session of its own: Ctrl-C must not take the page away while the robot brakes
        self._process = subprocess.Popen(
            [sys.executable, "-m", self._module, str(descriptors[0])],
            pass_fds=descriptors,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )
        theirs.close()
        self._close_doors()
        return self

    def start(self, source: Source, still: Packet) -> None:
        """Send what `source` gives, ten times a second, from a thread of its own.

        `still` holds what does not change: it is sent first.
        """
        self._source, self._still = source, still
        self._thread = threading.Thread(target=self._run, name="live-feed", daemon=True)
        self._thread.start()

    def say(self, packet: Packet) -> bool:
        """Send a packet now."""
        return self._channel is not None and self._channel.send(packet)

    def listen(self) -> None:
        """Hear what the page's process has sent back."""
        try:
            while self._channel is not None and (packet := self._channel.receive()) is not None:
                if self._on_word is not None:
                    self._on_word(str(packet.get("word")))
        except EOFError:
            self.problem = "the live page is served no more: its process has ended"

    def __exit__(self, *error: object) -> None:
        """Serve the page no more."""
        self._quit.set()
        if self._thread is not None:
            self._thread.join()
        if self._channel is not None:
            self._channel.close()
        if self._process is not None:
            try:
                self._process.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._close_doors()

    def _close_doors(self) -> None:
        for door in self._doors:
            door.close()
        self._doors = []

    def _run(self) -> None:
        assert self._source is not None
        while not self._quit.wait(PERIOD) and not self.problem:
            try:
                if self._still and self.say(self._still):
                    self._still = {}
                self.say(self._source())
                self.listen()
            except Exception as failure:  # a page must not stop a robot
                self.problem = f"the live page shows no more: {type(failure).__name__}: {failure}"


def tell_links(links: Sequence[str]) -> None:
    """Print the links to open."""
    for link in links:
        sys.stderr.write(f"live   {link}\n")
    sys.stderr.flush()
