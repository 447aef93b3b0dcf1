"""Signing keys: made, read, given to a vehicle over a private link; the newest time on disk.

The newest signing time that was accepted is kept, so that recordings stay refused after a restart:
a computer without a battery-backed clock starts in 1970, when every recorded frame looks new.
"""

from __future__ import annotations

import hashlib
import ipaddress
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.drivers.mavlink.codec import SIGNING_EPOCH, MavlinkCodec, signing_time
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.link import Transport
from firmware_bridge.link.url import LinkUrl
from firmware_bridge.messages import ConfigError, LinkError

PERIOD = 30.0
"""Between writes [s]: as seldom as ArduPilot itself writes its own."""
LONGEST = 32


class SigningStamp:
    """Keeps the newest time stamp of a key beside it, as KEY.stamp.

    Parameters
    ----------
    key_file : str or None
        Of the key; None: nothing is signed, and nothing kept.

    Raises
    ------
    ConfigError
        If the file is there and cannot be read.
    """

    def __init__(self, key_file: str | None) -> None:
        self._path = None if key_file is None else Path(f"{key_file}.stamp")
        self._kept = self._read()
        self._due = -float("inf")
        self.problem = ""
        """Why it cannot be kept."""

    @property
    def unix_time(self) -> float:
        """Unix time of the stamp that is kept [s]; 0 without one."""
        return SIGNING_EPOCH + self._kept * 1e-5 if self._kept else 0.0

    def keep(self, stamp: int, now: float) -> None:
        """Write a newer stamp [10 us since 2015], every 30 s at most; `now` is monotonic [s]."""
        if self._path is None or stamp <= self._kept or now < self._due:
            return
        self._due = now + PERIOD
        part = self._path.with_name(self._path.name + ".part")
        try:
            part.unlink(missing_ok=True)
            with open(os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "w") as file:
                file.write(f"{stamp}\n")
                file.flush()
                os.fsync(file.fileno())
            part.replace(self._path)
        except OSError as error:
            self.problem = (
                f"{self._path}: cannot keep the signing time: {error.strerror or error}: after a "
                "restart without a clock, recorded frames would be accepted"
            )
        else:
            self._kept, self.problem = stamp, ""

    def _read(self) -> int:
        if self._path is None:
            return 0
        try:
            with open(self._path, encoding="ascii") as file:
                text = file.read(LONGEST)
            stamp = int(text)
            if not 0 <= stamp < 2**48:
                raise ValueError
        except FileNotFoundError:
            return 0
        except OSError as error:
            raise ConfigError(f"key_file: {self._path}: {error.strerror or error}") from None
        except ValueError:
            raise ConfigError(
                f"key_file: {self._path}: expected one number, the newest signing time in 10 us: "
                "remove the file if no other program can send to the vehicle"
            ) from None
        return stamp


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
