"""Messages of a recorded drive are of Foxglove's kinds, and as their schemas say."""

import json
from collections.abc import Iterator
from dataclasses import replace
from io import BytesIO
from typing import Any

import pytest
from drive_kinds import every_kind

import kmpc_lite as kl
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
    cart = replace(scenario, footprint=kl.Footprint.rectangle(0.3, 0.2))
    for part in (content, every_kind(scenario), every_kind(cart)):
        for topic, name, schema, message in decoded(part):
            jsonschema.Draft202012Validator(schema).validate(message)
            assert name == schema["title"]
            seen.add(topic)
    assert seen == {topic.name for topic in TOPICS}
