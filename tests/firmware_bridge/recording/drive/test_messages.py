"""Messages of a recorded drive are of Foxglove's kinds, and as their schemas say."""

import json
from collections.abc import Iterator
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from drive_kinds import controller_of, every_kind

import kmpc_lite as kl
from firmware_bridge.recording.drive.encoder import DriveEncoder
from firmware_bridge.recording.drive.records import Stepped
from firmware_bridge.recording.drive.schemas import TOPICS
from kmpc_lite.scenario.files import Scenario


def decoded(content: bytes) -> Iterator[tuple[str, str, dict[str, Any], dict[str, Any]]]:
    """Topic, kind, schema and content of every message, by another library."""
    reader_of = pytest.importorskip("mcap.reader", reason="needs mcap")
    reader = reader_of.make_reader(BytesIO(content), validate_crcs=True)
    for schema, channel, message in reader.iter_messages():
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        yield channel.topic, schema.name, json.loads(schema.data), json.loads(message.data)


def test_every_message_is_as_its_schema_says(scenario: Scenario, content: bytes) -> None:
    jsonschema = pytest.importorskip("jsonschema", reason="needs jsonschema")
    seen = set()
    for part in (content, every_kind(scenario)):
        for topic, name, schema, message in decoded(part):
            jsonschema.Draft202012Validator(schema).validate(message)
            assert name == schema["title"]
            seen.add(topic)
    assert seen == {topic.name for topic in TOPICS}


def test_a_mirrored_scan_is_shown_where_it_was_seen(scenario: Scenario) -> None:
    plan = controller_of(scenario).step(scenario.start, scenario.goal)
    scan = kl.LaserScan([1.0], angle_min=0.5, angle_increment=0.1, range_max=4.0, mirrored=True)
    step = Stepped(
        0.0, (0, 0, 0), plan, np.empty((0, 2)), np.zeros(20), np.empty((0, 5)), None, scan
    )
    encoder = DriveEncoder(scenario, 0.1, {})
    whole = encoder.begin(0.0) + b"".join(encoder.encode([step]))
    scans = [message for topic, _, _, message in _streamed(whole) if topic == "/scan"]
    assert scans[0]["start_angle"] == -0.5


def _streamed(content: bytes) -> Iterator[tuple[str, str, str, dict[str, Any]]]:
    from kmpc_lite.learn.formats.mcap import read_messages

    for found in read_messages(BytesIO(content)):
        if found.topic.startswith("/"):
            yield found.topic, "", "", json.loads(found.content)
