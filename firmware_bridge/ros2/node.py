"""A node of rmw_zenoh: a session, its tokens, publishers and subscriptions.

Nothing runs in the session's own threads: each subscription keeps its newest messages outside of
Python until they are taken, so that a flood costs no more than what is taken.
"""

from __future__ import annotations

import hashlib
import json
import re
import struct
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from firmware_bridge.messages import ConfigError, LinkError
from firmware_bridge.ros2.message_types import DISTRIBUTIONS, LARGEST, MessageTypes
from firmware_bridge.ros2.names import (
    ADMIN,
    PUBLISHER,
    SUBSCRIPTION,
    NodeKey,
    Qos,
    Seen,
    TopicKey,
    read_token,
    resolve,
)

ROUTER = "tcp/localhost:7447"
"""Where rmw_zenoh's nodes look for their router."""
ENDPOINT = re.compile(r"[a-z]+(-[a-z]+)?/[^\s\"\\]{1,200}")
MOST_DOMAINS = 232
HEARTBEAT = 0.5
"""Period in which the number of a message kept for late subscribers is repeated [s]."""
ASKING = 0.5
"""Longest wait for the tokens of others [s]."""
MOST_TOKENS = 5000
"""Tokens of others that are looked at."""
POLL = 0.05


@dataclass(frozen=True)
class NodeOptions:
    """Which node, and where its network is.

    Raises
    ------
    ConfigError
        Names the option that is wrong.
    """

    name: str = "kmpc"
    namespace: str = "/"
    domain: int = 0
    """ROS_DOMAIN_ID."""
    distribution: str = "jazzy"
    connect: tuple[str, ...] = (ROUTER,)
    """Zenoh endpoints to connect to."""
    listen: tuple[str, ...] = ("tcp/localhost:0",)
    """Zenoh endpoints where peers connect."""
    router: bool = False
    """Whether to be the router oneself."""

    def __post_init__(self) -> None:
        """Check all."""
        if self.distribution not in DISTRIBUTIONS:
            raise ConfigError(
                f"distro: expected {', '.join(DISTRIBUTIONS)}, got {self.distribution!r}"
            )
        if isinstance(self.domain, bool) or not 0 <= self.domain <= MOST_DOMAINS:
            raise ConfigError(f"domain: expected 0 to {MOST_DOMAINS}, got {self.domain}")
        if self.namespace != "/":
            resolve(self.namespace, "/", "namespace")
        if "/" in self.name:
            raise ConfigError(f"name: expected a name without /, got {self.name!r}")
        resolve(self.name, "/", "name")
        for endpoint in (*self.connect, *self.listen):
            if not ENDPOINT.fullmatch(endpoint):
                raise ConfigError(
                    f"connect: expected a zenoh endpoint such as {ROUTER}, got {endpoint[:80]!r}"
                )

    @property
    def root(self) -> str:
        """The namespace, from the root."""
        return "/" + self.namespace.strip("/")


class Publisher:
    """Puts messages of one topic."""

    def __init__(self, put: Any, types: MessageTypes, token: str) -> None:
        self._put, self._types = put, types
        # rmw_zenoh hashes the token with another function; it only tells publishers apart
        self._gid = hashlib.blake2b(token.encode(), digest_size=16).digest()
        self.count = 0
        """Messages so far."""

    def publish(self, message: Any) -> None:
        """Send a message, with its number, time and sender, as rmw_zenoh requires."""
        self.count += 1
        about = struct.pack("<qqB16s", self.count, time.time_ns(), 16, self._gid)
        self._put.put(self._types.encode(message), attachment=about)


class Subscription:
    """The newest messages of one topic."""

    def __init__(self, declare: Callable[[], Any], topic: TopicKey, types: MessageTypes) -> None:
        self._declare, self._types = declare, types
        self._source = declare()
        self.topic = topic
        self.received = self.malformed = 0
        self.last_error = ""

    def ask_again(self) -> None:
        """Subscribe anew: publishers that keep their last message send it once more."""
        before, self._source = self._source, self._declare()
        before.undeclare()

    def take(self) -> tuple[Any, int] | None:
        """Take the oldest message that is kept, decoded, and its size [bytes].

        The message is None if it is malformed. Without any there is nothing to take. Never
        raises.
        """
        try:
            sample = self._source.try_recv()
            if sample is None:
                return None
            self.received += 1
            size = len(sample.payload)
            if size > LARGEST[self.topic.kind]:
                raise ValueError(f"a message of {size:,} bytes")
            return self._types.decode(bytes(sample.payload), self.topic.kind), size
        except Exception as error:  # whatever is on the network, the robot goes on
            self.malformed += 1
            self.last_error = f"{self.topic.name}: {error}"
            return None, 0


class Node:
    """A session with its node.

    Parameters
    ----------
    options : NodeOptions
        Which node, and where.
    """

    def __init__(self, options: NodeOptions) -> None:
        self.options = options
        self.types = MessageTypes(options.distribution)
        self._session: Any = None
        self._key: NodeKey | None = None
        self._kept: list[Any] = []
        """Tokens, publishers and subscriptions, which end when they are released."""
        self._number = 0

    def open(self) -> None:
        """Open the session and appear as a node; LinkError where it cannot."""
        import zenoh

        options = self.options
        config = zenoh.Config()
        for key, value in {
            "mode": "router" if options.router else "peer",
            "connect/endpoints": list(options.connect),
            "connect/exit_on_failure": False,
            "connect/timeout_ms": -1,
            "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000},
            "listen/endpoints": list(options.listen),
            "scouting/multicast/enabled": False,
            "scouting/delay": 1,
            # kept messages are distinguished by their time
            "timestamping/enabled": True,
        }.items():
            config.insert_json5(key, json.dumps(value))
        try:
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            where = ", ".join(options.listen if options.router else options.connect)
            raise LinkError(f"zenoh at {where}: {str(error).splitlines()[0][:200]}") from error
        zid = str(self._session.info.zid())
        self._key = NodeKey(options.domain, zid, options.root, options.name)
        self._declare(self._key.token())

    @property
    def connected(self) -> bool:
        """Whether a router or a peer is there."""
        info = self._session.info
        return bool(list(info.routers_zid()) or list(info.peers_zid()))

    def wait(self, timeout: float) -> None:
        """Wait for a router or a peer; LinkError after `timeout` [s]."""
        until = time.monotonic() + timeout
        while not self.connected:
            if time.monotonic() > until:
                raise LinkError(
                    f"no Zenoh router at {', '.join(self.options.connect)} after {timeout:g} s: "
                    "is `ros2 run rmw_zenoh_cpp rmw_zenohd` running, or `kmpc emulate ros2`?"
                )
            time.sleep(POLL)

    def publisher(self, name: str, kind: str, qos: Qos) -> Publisher:
        """Declare a publisher; one that keeps messages gives them to whoever comes late."""
        from zenoh import CongestionControl, ext

        topic, token = self._topic(name, kind, PUBLISHER, qos)
        options: dict[str, Any] = {"congestion_control": CongestionControl.DROP}
        if qos.transient_local:
            missed = ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=HEARTBEAT)
            put: Any = ext.declare_advanced_publisher(
                self._session,
                topic.key(self.options.domain),
                cache=ext.CacheConfig(qos.depth),
                publisher_detection=True,
                sample_miss_detection=missed if qos.reliable else None,
                **options,
            )
        else:
            put = self._session.declare_publisher(topic.key(self.options.domain), **options)
        self._kept.append(put)
        self._declare(token)
        return Publisher(put, self.types, token)

    def subscription(self, name: str, kind: str, qos: Qos) -> Subscription:
        """Declare a subscription that keeps its newest `qos.depth` messages."""
        from zenoh import ext, handlers

        topic, token = self._topic(name, kind, SUBSCRIPTION, qos)
        key = topic.key(self.options.domain)

        def declare() -> Any:
            ring: Any = handlers.RingChannel(qos.depth)
            if not qos.transient_local:
                return self._session.declare_subscriber(key, ring)
            late = ext.HistoryConfig(detect_late_publishers=True, max_samples=qos.depth)
            return ext.declare_advanced_subscriber(self._session, key, ring, history=late)

        subscription = Subscription(declare, topic, self.types)
        self._kept.append(subscription)
        self._declare(token)
        # rosbags writes the decoder when the first message of a type comes: that one shall not wait
        self.types.prepare(kind)
        return subscription

    def seen(self) -> Sequence[Seen]:
        """Nodes, publishers and subscriptions that are there, our own too, as tokens tell."""
        found = []
        replies = self._session.liveliness().get(
            f"{ADMIN}/{self.options.domain}/**", timeout=ASKING
        )
        for number, reply in enumerate(replies):
            if number >= MOST_TOKENS:
                break
            if reply.ok is not None and (seen := read_token(str(reply.ok.key_expr))) is not None:
                found.append(seen)
        return found

    def close(self) -> None:
        """Leave the network; idempotent."""
        session, self._session = self._session, None
        self._kept.clear()
        if session is not None:
            session.close()

    def _topic(self, name: str, kind: str, entity: str, qos: Qos) -> tuple[TopicKey, str]:
        """Name a topic and the token of its next publisher or subscription."""
        assert self._key is not None, "open comes first"
        full = resolve(name, self.options.root, "topic")
        topic = TopicKey(full, kind, self.types.type_hash(kind))
        self._number += 1
        return topic, self._key.topic_token(self._number, entity, topic, qos)

    def _declare(self, token: str) -> None:
        self._kept.append(self._session.liveliness().declare_token(token))
