"""Decoders of what is on the wire, written from the protocols' pages and sharing no code with the
drivers.
"""

import struct

CRC_EXTRA = {0: 50, 30: 39, 32: 185, 84: 143, 193: 71}
"""HEARTBEAT, ATTITUDE, LOCAL_POSITION_NED, SET_POSITION_TARGET_LOCAL_NED, EKF_STATUS_REPORT"""
SIZES = {0: 9, 30: 28, 32: 28, 84: 53, 193: 26}


def _table() -> list[int]:
    table = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x8408 if crc & 1 else 0)
        table.append(crc)
    return table


TABLE = _table()


def x25(data: bytes) -> int:
    """CRC-16/MCRF4XX, as MAVLink wants it."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ TABLE[(crc ^ byte) & 0xFF]
    return crc


class MavlinkEar:
    """Finds every whole MAVLink 2 frame of the kinds above in a stream, wherever it begins."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._offset = 0
        self._seen: set[int] = set()

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Message ids and zero-filled payloads of the frames that are now whole."""
        self._buffer += data
        found, start = [], 0
        while (start := self._buffer.find(0xFD, start)) >= 0:
            frame = None if self._offset + start in self._seen else self._frame(start)
            if frame is not None:
                self._seen.add(self._offset + start)
                found.append(frame)
            start += 1
        surplus = max(0, len(self._buffer) - 300)
        del self._buffer[:surplus]
        self._offset += surplus
        self._seen = {place for place in self._seen if place >= self._offset}
        return found

    def _frame(self, start: int) -> tuple[int, bytes] | None:
        head = self._buffer[start : start + 10]
        if len(head) < 10:
            return None
        kind, length = int.from_bytes(head[7:10], "little"), head[1]
        end = start + 10 + length
        if kind not in CRC_EXTRA or end + 2 > len(self._buffer):
            return None
        if x25(bytes(self._buffer[start + 1 : end]) + bytes((CRC_EXTRA[kind],))) != int.from_bytes(
            self._buffer[end : end + 2], "little"
        ):
            return None
        return kind, bytes(self._buffer[start + 10 : end]).ljust(SIZES[kind], b"\0")


def mavlink_frame(kind: int, payload: bytes, system: int) -> bytes:
    """An unsigned MAVLink 2 frame."""
    body = bytes((len(payload), 0, 0, 0, system, 1)) + kind.to_bytes(3, "little") + payload
    return b"\xfd" + body + x25(body + bytes((CRC_EXTRA[kind],))).to_bytes(2, "little")


def with_nan(frame: bytes) -> bytes:
    """A LOCAL_POSITION_NED frame whose x is not a number."""
    payload = frame[10:-2].ljust(SIZES[32], b"\0")
    return mavlink_frame(32, payload[:4] + struct.pack("<f", float("nan")) + payload[8:], frame[5])


def position(payload: bytes) -> tuple[float, float]:
    """North and east of LOCAL_POSITION_NED [m]."""
    north, east = struct.unpack("<ff", payload[4:12])
    return north, east


def set_point(payload: bytes) -> tuple[float, float, int, int]:
    """Forward speed [m/s], turn rate counter-clockwise [rad/s], type mask and frame of
    SET_POSITION_TARGET_LOCAL_NED.
    """
    _, *values, mask, _, _, frame = struct.unpack("<I11fHBBB", payload)
    vx, vy, yaw_rate = values[3], values[4], values[10]
    assert vy == 0.0
    return vx, 0.0 - yaw_rate, mask, frame


def armed_in_guided(payload: bytes) -> bool:
    """Whether a HEARTBEAT says so."""
    custom_mode, _, _, base_mode = struct.unpack("<IBBB", payload[:7])
    return custom_mode == 15 and bool(base_mode & 128)
