"""A node on a real network, beside an independent client of the protocol."""

from collections.abc import Iterator
from typing import Any

import pytest
from waiting import until

pytest.importorskip("zenoh", reason="the extra ros2 (eclipse-zenoh) is not installed")

from free_port import free_port

from firmware_bridge.messages import ConfigError, LinkError
from firmware_bridge.ros2.message_types import ODOMETRY, TWIST
from firmware_bridge.ros2.names import Qos
from firmware_bridge.ros2.node import Node, NodeOptions
from firmware_bridge.ros2.outputs import Outputs


@pytest.fixture
def router() -> Iterator[Node]:
    node = Node(NodeOptions(name="router", router=True, connect=(), listen=(_here(free_port()),)))
    node.open()
    yield node
    node.close()


@pytest.fixture
def node(router: Node) -> Iterator[Node]:
    node = Node(NodeOptions(connect=router.options.listen))
    node.open()
    node.wait(5.0)
    yield node
    node.close()


def _here(port: int) -> str:
    return f"tcp/127.0.0.1:{port}"


def _port(router: Node) -> int:
    return int(router.options.listen[0].rpartition(":")[2])


def test_the_independent_client_sees_our_topics_and_hears_our_commands(
    router: Node, node: Node
) -> None:
    clients = pytest.importorskip("ros_client", reason="zenoh-ros2-sdk is missing")
    discovery = pytest.importorskip("zenoh_ros2_sdk.discovery")
    heard: list[Any] = []
    commands = node.publisher("cmd_vel", TWIST, Qos(depth=1))
    node.subscription("odom", ODOMETRY, Qos(reliable=False, depth=5))
    command = Outputs(node.types, "map").command(0.25, -0.5, None, "")
    with clients.ros_client(_port(router), node.types) as client:
        port = {"router_ip": "127.0.0.1", "router_port": _port(router)}
        # what is asserted is what was waited for: a second question may be answered late
        topics: dict[str, Any] = {}
        assert until(
            lambda: (
                topics.update(discovery.get_topic_names_and_types(**port))
                or {"/cmd_vel", "/odom"} <= topics.keys()
            )
        )
        assert topics["/cmd_vel"] == [TWIST] and topics["/odom"] == [ODOMETRY]
        infos: list[Any] = []
        assert until(
            lambda: (
                infos.append(discovery.get_topic_info("/odom", verbose=True, **port))
                or (infos[-1] and infos[-1].subscribers)
            )
        )
        assert [one.node_name.strip("/") for one in infos[-1].subscribers] == ["kmpc"]
        assert infos[-1].subscribers[0].qos == "2::,5:,:,:,,"
        client.subscriber("/cmd_vel", TWIST, heard.append)
        assert until(lambda: commands.publish(command) or heard)
    assert heard[0].linear.x == 0.25 and heard[0].angular.z == -0.5


def test_we_hear_the_independent_client(router: Node, node: Node) -> None:
    clients = pytest.importorskip("ros_client", reason="zenoh-ros2-sdk is missing")
    subscription = node.subscription("/cmd_vel", TWIST, Qos(depth=1))
    command = Outputs(node.types, "map").command(0.25, -0.5, None, "")
    with clients.ros_client(_port(router), node.types) as client:
        publisher = client.publisher("/cmd_vel", TWIST)
        taken: list[Any] = []

        def came() -> bool:
            publisher.publish(linear=command.linear, angular=command.angular)
            taken.append(subscription.take())
            return taken[-1] is not None

        assert until(came)
        assert taken[-1][0].linear.x == 0.25 and taken[-1][0].angular.z == -0.5
        assert until(lambda: ("/cmd_vel", TWIST) in [(s.topic, s.kind) for s in node.seen()])


def test_an_attachment_is_what_rmw_zenoh_reads(router: Node, node: Node) -> None:
    attachment = pytest.importorskip("zenoh_ros2_sdk.attachment", reason="no zenoh-ros2-sdk")
    import zenoh

    ring = zenoh.handlers.RingChannel(1)
    source = router._session.declare_subscriber("0/cmd_vel/**", ring)
    publisher = node.publisher("cmd_vel", TWIST, Qos())
    command = Outputs(node.types, "map").command(1.0, 0.0, None, "")
    samples: list[Any] = []
    assert until(
        lambda: publisher.publish(command) or samples.append(source.try_recv()) or samples[-1]
    )
    read = attachment.Attachment.from_bytes(bytes(samples[-1].attachment))
    assert 1 <= read.sequence_id <= publisher.count and len(read.gid) == 16
    assert len(bytes(samples[-1].attachment)) == 33


def test_a_port_that_is_taken_is_reported_in_one_line(router: Node) -> None:
    node = Node(NodeOptions(router=True, connect=(), listen=router.options.listen))
    with pytest.raises(LinkError, match="Address already in use") as told:
        node.open()
    assert "\n" not in str(told.value) and len(str(told.value)) < 300


@pytest.mark.parametrize(
    "wrong",
    [{"domain": -1}, {"domain": True}, {"name": "a/b"}, {"name": ""}, {"listen": ("tcp/",)}],
)
def test_options_that_are_wrong_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        NodeOptions(**wrong)
