"""MCAP files: an independent reader takes them, ours takes what a power cut has left."""

import json
import struct
from io import BytesIO
from zlib import crc32

import pytest
from mcap_bytes import CHUNK, FOOTER, MESSAGES, RECORD, record

from firmware_bridge.recording.drive.mcap_writer import McapWriter, Message, Topic
from kmpc_lite.learn.formats.mcap import MAGIC, read_messages

A = {"title": "test.A", "type": "object", "properties": {"n": {"type": "integer"}}}
TOPICS = (Topic("/a", "test.A", A), Topic("/b", "test.A", A))


def messages(first: int, count: int) -> list[Message]:
    return [Message("/ab"[:1] + "ab"[n % 2], 10**6 * n, {"n": n}) for n in range(first, count)]


def pieces() -> list[bytes]:
    writer = McapWriter(TOPICS)
    parts = [writer.begin("a test"), writer.metadata("about", {"is": "a test", "ü": "ö"})]
    parts += [writer.chunk(messages(10 * k, 10 * k + 10)[::-1]) for k in range(4)]
    assert writer.chunk([]) == b""
    return [*parts, writer.end()]


def test_another_library_reads_every_message_and_jumps() -> None:
    reader_of = pytest.importorskip("mcap.reader", reason="needs mcap")
    content = b"".join(pieces())
    reader = reader_of.make_reader(BytesIO(content), validate_crcs=True)
    found = [(c.topic, m.log_time, json.loads(m.data)) for _, c, m in reader.iter_messages()]
    assert found == [("/" + "ab"[n % 2], 10**6 * n, {"n": n}) for n in range(40)]
    late = list(reader.iter_messages(topics=["/b"]))
    assert [m.log_time // 10**6 for _, _, m in late] == list(range(1, 40, 2))
    summary = reader.get_summary()
    assert summary.statistics.message_count == 40 and summary.statistics.chunk_count == 4
    span = summary.statistics.message_start_time, summary.statistics.message_end_time
    assert span == (0, 39 * 10**6)
    assert {s.name: s.encoding for s in summary.schemas.values()} == {"test.A": "jsonschema"}
    assert [m.metadata for m in reader.iter_metadata()] == [{"is": "a test", "ü": "ö"}]
    stream = pytest.importorskip("mcap.stream_reader")
    records = list(stream.StreamReader(BytesIO(content), validate_crcs=True).records)
    assert records[-1].summary_start > 0


def test_a_file_that_was_cut_anywhere_is_read_up_to_its_last_whole_piece() -> None:
    whole = pieces()
    content, ends = b"".join(whole), []
    for piece in whole:
        ends.append(len(piece) + (ends[-1] if ends else 0))
    for size in range(ends[0], len(content), 7):
        found = [m for m in read_messages(BytesIO(content[:size])) if m.topic[0] == "/"]
        complete = sum(size >= end for end in ends[2:6])
        # a chunk may be whole without the index that follows it
        assert 10 * complete <= len(found) <= 10 * complete + 10, size


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (MAGIC, "not an MCAP file"),
        (MAGIC + record(FOOTER, b"") + MAGIC, "not an MCAP file"),
        (pieces()[0].replace(b"kmpc", b"ros2", 1), "the profile 'ros2'"),
        (pieces()[0] + record(MESSAGES, struct.pack("<HIQQ", 9, 1, 0, 0)), "not announced"),
    ],
)
def test_what_is_none_is_refused_in_one_line(content: bytes, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        list(read_messages(BytesIO(content)))


def test_lengths_that_lie_take_no_memory() -> None:
    begin = pieces()[0]
    huge = RECORD.pack(CHUNK, 2**62)
    assert list(read_messages(BytesIO(begin + huge))) == []
    inner = RECORD.pack(MESSAGES, 2**62)
    head = struct.pack("<QQQI", 0, 0, len(inner), crc32(inner)) + struct.pack("<IQ", 0, len(inner))
    with pytest.raises(ValueError, match="a chunk is damaged"):
        list(read_messages(BytesIO(begin + record(CHUNK, head + inner))))
    packed = (
        struct.pack("<QQQI", 0, 0, 9, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", 0)
    )
    with pytest.raises(ValueError, match="packed with 'zstd'"):
        list(read_messages(BytesIO(begin + record(CHUNK, packed))))


def test_not_a_number_is_not_written() -> None:
    writer = McapWriter(TOPICS)
    with pytest.raises(ValueError, match="not JSON compliant"):
        writer.chunk([Message("/a", 0, {"n": float("nan")})])
