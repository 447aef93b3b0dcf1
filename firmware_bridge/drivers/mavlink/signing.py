"""Signing keys: made, read, and given to a vehicle over a private link."""

from __future__ import annotations

import hashlib
import ipaddress
import threading
import time
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec, signing_time
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.link import Transport
from firmware_bridge.link.url import LinkUrl
from firmware_bridge.messages import LinkError

REPEAT, TIMES = 0.2, 3
"""Time between repeats of the key [s], and their number: the vehicle acknowledges none."""
TICK = 0.1
"""Between heartbeats and questions [s]."""


def passphrase_key(passphrase: str) -> bytes:
    """Key (32 bytes) of a passphrase, as MAVProxy, Mission Planner and QGroundControl make it.

    Examples
    --------
    >>> passphrase_key("secret").hex()[:16]
    '2bb80d537b1da3e3'
    """
    return hashlib.sha256(passphrase.encode("utf-8")).digest()


def others_may_listen(url: str) -> bool:
    """Whether a link goes over a network that other computers may share.

    Examples
    --------
    >>> others_may_listen("tcp:127.0.0.1:5760"), others_may_listen("udp:192.168.1.5:14550")
    (False, True)
    """
    link = LinkUrl.parse(url)
    if link.kind not in ("tcp", "udp"):
        return False
    host, _ = link.address()
    try:
        return not ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host != "localhost"


class _Link:
    """A transport, and a codec, on which one can wait for a message."""

    def __init__(self, transport: Transport, options: MavlinkOptions) -> None:
        self._transport, self._options = transport, options
        self._changed = threading.Condition()
        self._messages: list[Any] = []
        self.codec = MavlinkCodec(*options.us)
        transport.start(self._take)

    def use(self, codec: MavlinkCodec) -> None:
        """Read and write with another codec from now on."""
        with self._changed:
            self.codec, self._messages = codec, []

    def send(self, message: Any) -> None:
        """Write a message."""
        with self._changed:
            self._transport.write(self.codec.encode(message))

    def wait(self, wanted: Callable[[Any], bool], timeout: float, say: Callable[[], None]) -> Any:
        """Give the first message of the vehicle that is wanted, None without; `say` goes on."""
        until = time.monotonic() + timeout
        while time.monotonic() < until:
            say()
            with self._changed:
                self._changed.wait(TICK)
                messages, self._messages = self._messages, []
            for message in messages:
                if message.get_srcSystem() == self._options.system and wanted(message):
                    return message
        return None

    def _take(self, data: bytes, stamp: float) -> None:
        with self._changed:
            self._messages += self.codec.feed(data, stamp)
            self._changed.notify_all()


def give_key(transport: Transport, options: MavlinkOptions, key: bytes, timeout: float) -> None:
    """Give a vehicle its key, and see that it signs with it and accepts what we sign.

    Parameters
    ----------
    transport : Transport
        Not yet started; it is closed in the end.
    options : MavlinkOptions
        Which vehicle; its `key_file` holds the key that it has so far, if any.
    key : bytes
        32 bytes.
    timeout : float
        How long each step may take [s].

    Raises
    ------
    LinkError
        With what the vehicle said, or did not say.
    """
    link = _Link(transport, options)
    try:
        _hand_over(link, options, key, timeout)
    finally:
        transport.close()


def _hand_over(link: _Link, options: MavlinkOptions, key: bytes, timeout: float) -> None:
    old = options.read_key()
    if old is not None and old != key:
        link.use(MavlinkCodec(*options.us, key=old, wall_time=time.time()))
    beat = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    heard = link.wait(lambda m: m.get_type() == "HEARTBEAT", timeout, lambda: link.send(beat))
    if heard is None:
        raise LinkError(f"mavlink: no heartbeat of system {options.system} within {timeout:g} s")
    if heard.base_mode & dialect.MAV_MODE_FLAG_SAFETY_ARMED:
        raise LinkError("mavlink: the vehicle is armed: it takes a key while disarmed only")
    message = dialect.MAVLink_setup_signing_message(
        options.system, options.component, tuple(key), signing_time(time.time())
    )
    for _ in range(TIMES):
        link.send(message)
        time.sleep(REPEAT)
    link.use(MavlinkCodec(*options.us, key=key, wall_time=time.time()))
    asked = [1]

    def ask() -> None:
        link.send(beat)
        asked[0] += 1
        link.send(dialect.MAVLink_timesync_message(0, asked[0]))

    answer = link.wait(lambda m: m.get_type() == "TIMESYNC" and m.tc1 != 0, timeout, ask)
    if answer is None:
        raise LinkError(
            "mavlink: the vehicle does not sign with this key: has it another one? Send it over "
            "its first port (USB), which takes unsigned frames, or give the other as board.key_file"
        )
