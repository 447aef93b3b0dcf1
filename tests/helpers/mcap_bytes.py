"""Records of MCAP files, byte by byte, as no writer makes them."""

import struct

RECORD, MESSAGE = struct.Struct("<BQ"), struct.Struct("<HIQQ")
"""Kind and length of a record; channel, number, and twice the time of a message [ns]."""
FOOTER, CHANNEL, MESSAGES, CHUNK, METADATA = 2, 4, 5, 6, 12


def record(kind: int, content: bytes) -> bytes:
    """A whole record."""
    return RECORD.pack(kind, len(content)) + content
