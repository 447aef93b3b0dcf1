"""Lines of text, and the XOR that those of an ODrive may carry."""

from __future__ import annotations

LINE_BYTES = 256


def odrive_line(text: str, checksum: bool) -> bytes:
    r"""Build a line, with its XOR if asked.

    Examples
    --------
    >>> odrive_line("r vbus_voltage ", True)
    b'r vbus_voltage *93\n'
    """
    body = text.encode("ascii")
    return body + (b"*%d" % xor8(body) if checksum else b"") + b"\n"


def xor8(data: bytes) -> int:
    """XOR of all bytes."""
    total = 0
    for byte in data:
        total ^= byte
    return total


def odrive_text(line: bytes, checksum: bool) -> str | None:
    """Text of a line, None for a damaged one.

    `line`: without its end. `checksum`: whether it must carry one; one that is there is always
    checked.
    """
    body, star, digits = line.partition(b"*")
    if star:
        if not digits.strip().isdigit() or int(digits) != xor8(body):
            return None
    elif checksum:
        return None
    text = body.strip()
    printable = text.isascii() and text.decode("latin-1").isprintable()
    return text.decode("ascii") if text and printable else None


class Lines:
    """Cuts bytes into lines that end in CR, LF or both.

    A line of more than 256 bytes is dropped up to its end. A checksum that fits ends a line, too:
    an ODrive's firmware before 0.5.3 sends no end behind one.
    """

    def __init__(self) -> None:
        self._buffer, self._dropping = bytearray(), False
        self.bad = 0
        """Bytes dropped."""

    def reset(self) -> None:
        """Forget half a line."""
        self.bad += len(self._buffer)
        self._buffer.clear()

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes; returns whole lines without their ends."""
        *whole, rest = (bytes(self._buffer) + data).replace(b"\r", b"\n").split(b"\n")
        if self._dropping and whole:
            self.bad += len(whole.pop(0))
            self._dropping = False
        found = [line for line in whole if line and len(line) <= LINE_BYTES]
        self.bad += sum(len(line) for line in whole if len(line) > LINE_BYTES)
        if len(rest) > LINE_BYTES or self._dropping:
            self.bad += len(rest)
            self._dropping, rest = True, b""
        if b"*" in rest and odrive_text(rest, True) is not None:
            found, rest = [*found, rest], b""
        self._buffer = bytearray(rest)
        return found
