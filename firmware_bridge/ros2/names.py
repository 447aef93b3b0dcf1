"""What rmw_zenoh calls nodes and topics: key expressions, liveliness tokens, QoS.

After rmw_zenoh's design page, https://github.com/ros2/rmw_zenoh/blob/jazzy/docs/design.md.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from firmware_bridge.messages import ConfigError

ADMIN = "@ros2_lv"
"""First part of every liveliness token."""
NODE, PUBLISHER, SUBSCRIPTION = "NN", "MP", "MS"
"""Kinds of entities; services and clients are SS and SC."""
DEFAULT_DEPTH = 42
"""The depth that rmw_zenoh leaves out of a token."""
PARTS_OF_NODE, PARTS_OF_TOPIC = 9, 13
LONGEST_NAME = 200
"""Characters of a ROS name that is still taken."""
NAME = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")


@dataclass(frozen=True)
class Qos:
    """Quality of service, as far as rmw_zenoh has it.

    Examples
    --------
    >>> Qos(transient_local=True, depth=1).encode()
    ':1:,1:,:,:,,'
    """

    reliable: bool = True
    transient_local: bool = False
    """Whether a late subscriber gets the last `depth` messages."""
    depth: int = 10

    def encode(self) -> str:
        """As in a token: what is rmw_zenoh's default (reliable, volatile, 42) is left out."""
        reliability = "" if self.reliable else "2"
        durability = "1" if self.transient_local else ""
        depth = "" if self.depth == DEFAULT_DEPTH else str(self.depth)
        return f"{reliability}:{durability}:,{depth}:,:,:,,"


@dataclass(frozen=True)
class TopicKey:
    """A topic and its type."""

    name: str
    """From the root: /robot/odom."""
    kind: str
    """nav_msgs/msg/Odometry."""
    type_hash: str
    """RIHS01_..., of the distribution."""

    def key(self, domain: int) -> str:
        """Key expression that its messages are put to.

        Examples
        --------
        >>> TopicKey("/cmd_vel", "geometry_msgs/msg/Twist", "RIHS01_9c").key(0)
        '0/cmd_vel/geometry_msgs::msg::dds_::Twist_/RIHS01_9c'
        """
        return f"{domain}/{self.name.strip('/')}/{wire_type(self.kind)}/{self.type_hash}"


@dataclass(frozen=True)
class NodeKey:
    """A node of ours in a session."""

    domain: int
    session: str
    """The session's zenoh id, in hexadecimal digits."""
    namespace: str
    """From the root: / or /robot."""
    name: str

    def token(self) -> str:
        """Liveliness token of the node itself.

        Examples
        --------
        >>> NodeKey(0, "a1", "/", "kmpc").token()
        '@ros2_lv/0/a1/0/0/NN/%/%/kmpc'
        """
        return self._token(0, NODE)

    def topic_token(self, number: int, kind: str, topic: TopicKey, qos: Qos) -> str:
        """Liveliness token of a publisher or a subscription; each has its own number."""
        type_name = mangled(wire_type(topic.kind))
        return (
            f"{self._token(number, kind)}/{mangled(topic.name)}/{type_name}/{topic.type_hash}/"
            f"{qos.encode()}"
        )

    def _token(self, number: int, kind: str) -> str:
        # the middle % is the enclave, which is / outside of security
        where = f"{ADMIN}/{self.domain}/{self.session}/0/{number}/{kind}"
        return f"{where}/%/{mangled(self.namespace)}/{self.name}"


@dataclass(frozen=True)
class Seen:
    """What a token says."""

    entity: str
    """NN, MP, MS, SS or SC."""
    node: str
    """With its namespace: /robot/kmpc."""
    topic: str = ""
    kind: str = ""
    """nav_msgs/msg/Odometry."""
    type_hash: str = ""
    qos: str = ""


def read_token(token: str) -> Seen | None:
    """Take a liveliness token apart; None for what is none of rmw_zenoh's.

    Examples
    --------
    >>> read_token("@ros2_lv/0/a1/0/0/NN/%/%/kmpc")
    Seen(entity='NN', node='/kmpc', topic='', kind='', type_hash='', qos='')
    """
    parts = token.split("/")
    if len(parts) < PARTS_OF_NODE or parts[0] != ADMIN or "" in parts[:PARTS_OF_NODE]:
        return None
    namespace = parts[7].replace("%", "/").rstrip("/")
    entity, node = parts[5], f"{namespace}/{parts[8]}"
    if entity == NODE:
        return Seen(entity, node)
    if len(parts) < PARTS_OF_TOPIC:
        return None
    kind = parts[10].replace("::", "/").replace("/dds_/", "/").rstrip("_")
    return Seen(entity, node, parts[9].replace("%", "/"), kind, parts[11], parts[12])


def wire_type(kind: str) -> str:
    """Name of a type on the wire.

    Examples
    --------
    >>> wire_type("nav_msgs/msg/Odometry")
    'nav_msgs::msg::dds_::Odometry_'
    """
    package, folder, name = kind.split("/")
    return f"{package}::{folder}::dds_::{name}_"


def mangled(name: str) -> str:
    """Put a name into one part of a key expression."""
    return name.replace("/", "%")


def resolve(name: str, namespace: str, what: str) -> str:
    """Bring a ROS name to the root; one that begins with / is there already.

    Examples
    --------
    >>> resolve("odom", "/robot", "topic"), resolve("/odom", "/robot", "topic")
    ('/robot/odom', '/odom')

    Raises
    ------
    ConfigError
        For what ROS takes for no name.
    """
    if len(name) > LONGEST_NAME or not NAME.fullmatch(name):
        raise ConfigError(
            f"{what}: expected a ROS name such as odom or /robot/odom, got {name[:80]!r}"
        )
    return name if name.startswith("/") else f"{namespace.rstrip('/')}/{name}"
