"""Names on the wire, compared with those of an independent client of the protocol."""

import pytest

from firmware_bridge.ros2 import message_types
from firmware_bridge.ros2.names import (
    PUBLISHER,
    NodeKey,
    Qos,
    Seen,
    TopicKey,
    read_token,
)

NODE = NodeKey(7, "b0273db5eb9f463fd779148776b180d5", "/robot/one", "kmpc")
TOPIC = TopicKey("/robot/one/odom", "nav_msgs/msg/Odometry", "RIHS01_3c")
QOS = [
    Qos(),
    Qos(reliable=False, depth=5),
    Qos(transient_local=True, depth=1),
    Qos(depth=42),
]
KINDS = [
    value
    for name, value in vars(message_types).items()
    if name.isupper() and isinstance(value, str) and "/msg/" in value and "\n" not in value
]


def test_tokens_and_keys_are_those_of_the_independent_client() -> None:
    keys = pytest.importorskip("zenoh_ros2_sdk.keyexpr", reason="zenoh-ros2-sdk is missing")
    entity = pytest.importorskip("zenoh_ros2_sdk.entity")
    utils = pytest.importorskip("zenoh_ros2_sdk.utils")
    theirs = entity.NodeEntity(NODE.domain, NODE.session, 0, NODE.name, NODE.namespace)
    assert NODE.token() == keys.node_liveliness_keyexpr(theirs)
    qos = Qos(transient_local=True, depth=1)
    kind = utils.ros2_to_dds_type(TOPIC.kind)
    endpoint = entity.EndpointEntity(
        theirs, 3, entity.EntityKind.PUBLISHER, TOPIC.name, kind, TOPIC.type_hash, qos.encode()
    )
    token = NODE.topic_token(3, PUBLISHER, TOPIC, qos)
    assert token == keys.endpoint_liveliness_keyexpr(endpoint)
    assert TOPIC.key(7) == keys.topic_keyexpr(7, TOPIC.name, kind, TOPIC.type_hash)


@pytest.mark.parametrize("qos", QOS)
def test_the_independent_client_reads_the_quality_of_service(qos: Qos) -> None:
    client = pytest.importorskip("zenoh_ros2_sdk.qos", reason="zenoh-ros2-sdk is missing")
    read = client.QosProfile.decode(qos.encode())
    assert (read.reliability is client.QosReliability.RELIABLE) == qos.reliable
    assert (read.durability is client.QosDurability.TRANSIENT_LOCAL) == qos.transient_local
    # a depth that is left out is rmw_zenoh's 42, and another one of this client's
    assert read.history_depth == (10 if qos.depth == 42 else qos.depth)


def test_tokens_are_read_back() -> None:
    token = NODE.topic_token(3, PUBLISHER, TOPIC, Qos())
    assert read_token(token) == Seen(
        "MP", "/robot/one/kmpc", TOPIC.name, TOPIC.kind, TOPIC.type_hash, Qos().encode()
    )
    for wrong in ("", "@ros2_lv", "@ros2_lv/0/a/0/0/MP/%/%/kmpc", "x/" * 20, "@ros2_lv//////////"):
        assert read_token(wrong) is None


@pytest.mark.parametrize("distribution", ["jazzy", "kilted"])
def test_type_hashes_are_those_that_the_independent_client_computes(distribution: str) -> None:
    pytest.importorskip("rosbags", reason="the extra ros2 is not installed")
    utils = pytest.importorskip("zenoh_ros2_sdk.utils", reason="zenoh-ros2-sdk is missing")
    types = message_types.MessageTypes(distribution)
    assert len(KINDS) == 13
    for kind in KINDS:
        text, *nested = types.definition(kind).split("=" * 80 + "\n")
        parts = (part.removeprefix("MSG: ").split("\n", 1) for part in nested)
        inner = {name.replace("/", "/msg/", 1): body for name, body in parts}
        theirs = utils.get_type_hash(kind, msg_definition=text, dependencies=inner)
        assert types.type_hash(kind) == theirs, kind
