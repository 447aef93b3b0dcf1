"""Bytes <-> MAVLink messages.

The codec finds the next good frame after noise, takes versions 1 and 2 mixed, signs, and checks
signatures. The newest signing time that was accepted is kept on disk, so that recordings stay
refused after a restart: a computer without a battery-backed clock starts in 1970, when every
recorded frame looks new.

The dialect's own `parse_char` takes the length of a corrupt frame at its word and loses all frames
inside it (7 after one bad byte, measured), and its buffer grows for ever on a stream that never
pauses. Here a frame counts only once its CRC is right; otherwise one byte is skipped. The dialect
decodes, encodes, signs and verifies.
"""

from __future__ import annotations

import math
import os
import re
import struct
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.messages import ConfigError

MARKER = re.compile(rb"\xfd(?!.[^\x00\x01])|\xfe(?!\xfe.{3}\xfe)", re.DOTALL)
"""First byte of a frame: not before flags that no frame has, nor in a run of itself."""
HEADER = {dialect.PROTOCOL_MARKER_V1: 6, dialect.PROTOCOL_MARKER_V2: 10}
CRC_BYTES, SIGNATURE_BYTES = 2, 13
STALLED = 0.2
"""Bytes count as no frame if the rest has not come after this long [s]: the longest frame takes
0.05 s at 57600 baud."""
SIGNING_EPOCH = 1420070400
"""Signature time stamps count 10 us from 2015-01-01 UTC; this is that day in Unix time [s]."""
LINK_ID = 75
"""Of our signatures: a station that shares the link, and our ids, counts its time stamps under
another one, or a vehicle would take ours for old."""
COUNTERS = (
    "frames_in",
    "frames_out",
    "bad_data",
    "skipped_bytes",
    "signed",
    "unsigned",
    "bad_signature",
    "passed_over",
)
Wanted = Callable[[int, int, int], bool]
"""Whether a frame of this system and component with this message id is worth decoding."""
PERIOD = 30.0  # between writes [s]: as seldom as ArduPilot itself writes its own
LONGEST = 32


def signing_time(wall_time: float) -> int:
    """Time stamp of a signature [10 us since 2015] at a Unix time [s]; never below 0."""
    return max(0, int((wall_time - SIGNING_EPOCH) * 1e5))


class MavlinkCodec:
    """One end of a MAVLink stream.

    One thread may feed it while others encode.

    `system`, `component`: ids that our frames are sent with. `key`: 32 bytes: sign what is sent,
    refuse and count what comes unsigned or wrongly signed. `accept_unsigned`: with a key: count
    what comes unsigned or wrongly signed, and take it all the same, as ArduPilot does on its first
    port. `wall_time`: unix time to start signature time stamps at [s]; signing is the one place
    where the protocol asks for it. `wanted`: tells which frames to decode; others are counted and
    passed over, since decoding costs ten times as much as finding a frame.
    """

    def __init__(
        self,
        system: int,
        component: int,
        key: bytes | None = None,
        wall_time: float = 0.0,
        *,
        accept_unsigned: bool = False,
        wanted: Wanted | None = None,
    ) -> None:
        self._mav: Any = dialect.MAVLink(None, srcSystem=system, srcComponent=component)
        self._lock = threading.Lock()
        """Held for one frame: signing, and checking signatures, share the time stamp."""
        self._wanted = wanted
        self._buffer = bytearray()
        self._waiting_since = math.inf
        self.counters = dict.fromkeys(COUNTERS, 0)
        self.newest_stamp = 0  # newest time stamp of all correct signatures [10 us since 2015]
        self._check, self._mav.check_signature = self._mav.check_signature, self._check_signature
        if accept_unsigned:
            self._mav.signing.allow_unsigned_callback = lambda mav, message: True
        if key is not None:
            self.sign(key, signing_time(wall_time))

    def sign(self, key: bytes, timestamp: int) -> None:
        """Sign from now on, and require signatures; time stamps start at this one [10 us]."""
        signing = self._mav.signing
        signing.link_id = LINK_ID
        signing.secret_key, signing.sign_outgoing, signing.timestamp = key, True, timestamp

    def sign_no_more(self) -> None:
        """Stop signing, and take unsigned frames."""
        self._mav.signing.secret_key, self._mav.signing.sign_outgoing = None, False

    def encode(self, message: Any, version: int = 2) -> bytes:
        """Frame a message; ValueError for a value that its field cannot hold."""
        with self._lock:
            try:
                frame = bytes(message.pack(self._mav, force_mavlink1=version == 1))
            except (struct.error, OverflowError) as error:
                raise ValueError(f"{message.get_type()}: {error}") from error
            self._mav.seq = (self._mav.seq + 1) % 256
        self.counters["frames_out"] += 1
        return frame

    def feed(self, data: bytes, now: float) -> list[Any]:
        """Take bytes as they came and give the messages now whole, in order; never raises."""
        return list(self.messages(data, now))

    def messages(self, data: bytes, now: float) -> Iterator[Any]:
        """Take bytes as they came; each message is decoded when it is asked for."""
        for frame in self.frames(data, now):
            if self._wanted is not None and not self._wanted(*origin(frame)):
                self.counters["passed_over"] += 1
                continue
            message = self._decode(frame)
            if message is not None:
                self.counters["frames_in"] += 1
                yield message

    def frames(self, data: bytes, now: float) -> Iterator[bytearray]:
        """Take bytes as they came and give the frames now whole, their CRC checked, in order."""
        self._buffer += data
        start = 0
        try:
            while (start := self._next_marker(start)) < len(self._buffer):
                size = self._frame_size(start)
                if size > len(self._buffer) - start:
                    self._waiting_since = min(self._waiting_since, now)
                    if now - self._waiting_since < STALLED:
                        break
                    size = 0
                self._waiting_since = math.inf
                frame = self._buffer[start : start + size]
                if size and _crc_is_right(frame):
                    start += size
                    yield frame
                else:
                    self.counters["bad_data"] += 1
                    self.counters["skipped_bytes"] += 1
                    start += 1
        finally:
            del self._buffer[:start]

    def _next_marker(self, start: int) -> int:
        """Index of the next possible start of a frame; the buffer's length if there is none."""
        match = MARKER.search(self._buffer, start)
        found = len(self._buffer) if match is None else match.start()
        self.counters["skipped_bytes"] += found - start
        return found

    def _frame_size(self, start: int) -> int:
        """Bytes of the frame that would begin here, as far as is known; 0 if none can.

        A message id that the dialect does not know counts as no frame: without its definition the
        CRC cannot be checked.
        """
        buffer, known = self._buffer, len(self._buffer) - start
        header = HEADER[buffer[start]]
        if known < header:
            return header + CRC_BYTES
        flags, kind = 0, int(buffer[start + 5])
        if header == HEADER[dialect.PROTOCOL_MARKER_V2]:
            flags = buffer[start + 2]
            kind = int.from_bytes(buffer[start + 7 : start + 10], "little")
        if flags & ~dialect.MAVLINK_IFLAG_SIGNED or kind not in dialect.mavlink_map:
            return 0
        return header + int(buffer[start + 1]) + CRC_BYTES + (SIGNATURE_BYTES if flags else 0)

    def _decode(self, frame: bytearray) -> Any:
        """Message of a whole frame; None if its signature or its content is refused."""
        signed = frame[0] == dialect.PROTOCOL_MARKER_V2 and bool(frame[2])
        self.counters["signed"] += signed
        with self._lock:
            try:
                return self._mav.decode(frame)
            except dialect.MAVError:
                if self._mav.signing.secret_key is None:
                    self.counters["bad_data"] += 1
                else:
                    self.counters["bad_signature" if signed else "unsigned"] += 1
        return None

    def _check_signature(self, frame: bytearray, system: int, component: int) -> bool:
        """Verify a frame's signature.

        A forged frame must not move the stream's clock: the true frames after it would look
        old.
        """
        stamps = self._mav.signing.stream_timestamps
        stream = (frame[-SIGNATURE_BYTES], system, component)
        before = stamps.get(stream)
        good = bool(self._check(frame, system, component))
        if good:
            self.newest_stamp = max(self.newest_stamp, stamps[stream])
        else:
            stamps.pop(stream, None)
            if before is not None:
                stamps[stream] = before
        return good


def origin(frame: bytes | bytearray) -> tuple[int, int, int]:
    """System, component and message id of a frame."""
    if frame[0] == dialect.PROTOCOL_MARKER_V1:
        return frame[3], frame[4], frame[5]
    return frame[5], frame[6], int.from_bytes(frame[7:10], "little")


def _crc_is_right(frame: bytearray) -> bool:
    """Whether the CRC of a frame's bytes is right."""
    second = frame[0] == dialect.PROTOCOL_MARKER_V2
    end = len(frame) - (SIGNATURE_BYTES if second and frame[2] else 0)
    kind = dialect.mavlink_map[origin(frame)[2]]
    crc = dialect.x25crc(bytes(frame[1 : end - CRC_BYTES]) + bytes((kind.crc_extra,))).crc
    return bool(crc == int.from_bytes(frame[end - CRC_BYTES : end], "little"))


class SigningStamp:
    """Keeps the newest time stamp of a key beside it, as KEY.stamp.

    `key_file`: of the key; None: nothing is signed, and nothing kept. Raises ConfigError if the
    file is there and cannot be read.
    """

    def __init__(self, key_file: str | None) -> None:
        self._path = None if key_file is None else Path(f"{key_file}.stamp")
        self._kept = self._read()
        self._due = -float("inf")
        self.problem = ""  # why it cannot be kept

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
