"""A robot behind ROS 2 topics, as the bridge's gate and loop know robots."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

from firmware_bridge.kinematics import curvature_of
from firmware_bridge.messages import LinkStatus, State
from firmware_bridge.ros2.inputs import Inputs, Source
from firmware_bridge.ros2.message_types import TWIST, TWIST_STAMPED
from firmware_bridge.ros2.names import Qos
from firmware_bridge.ros2.node import Node, NodeOptions, Publisher, Subscription
from firmware_bridge.ros2.options import Ros2Options
from firmware_bridge.ros2.outputs import Outputs
from firmware_bridge.ros2.reader import SLOW_PAUSE, Reader
from kmpc_lite.learn.formats.ackermann import ACKERMANN_STAMPED

QUIET = 1.0
"""Without a goal zeros are published for so long, and then nothing: others may drive [s]."""
ASK_AGAIN = 3.0
"""Between two requests for maps that are missing [s]."""
COMMANDS = Qos(depth=1)


class Ros2Driver:
    """Listens to odometry and obstacles, and publishes commands.

    Parameters
    ----------
    node : NodeOptions
        Which node, and where its network is.
    options : Ros2Options
        What it listens to.
    inputs : Inputs, optional
        Take what it hears; its own if not given.
    is_wanted : callable, optional
        Whether there is a goal: without one, others may command the robot.
    clock : callable
        Monotonic time [s].
    """

    def __init__(
        self,
        node: NodeOptions,
        options: Ros2Options,
        inputs: Inputs | None = None,
        is_wanted: Callable[[], bool] = lambda: True,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.node, self.options, self._clock = Node(node), options, clock
        self.inputs = Inputs(options) if inputs is None else inputs
        self.outputs = Outputs(self.node.types, options.frame)
        self._is_wanted = is_wanted
        self._curvature = 0.0
        """To which a car's wheels are steered [1/m]."""
        self._commands: Publisher | None = None
        self.subscriptions: list[tuple[Subscription, Source]] = []
        """With the receivers of their messages."""
        self.readers: list[Reader] = []
        """Of all but maps, and of maps."""
        self._idle_since = -math.inf
        self._asked = clock()
        self._malformed: dict[str, int] = {}
        """What was no message on each map's topic when the map was asked for last."""

    def connect(self, timeout: float, read: bool = True) -> None:
        """Open the session and wait for a router or a peer; LinkError after `timeout` [s].

        Messages are read by threads of their own, or, if `read` is false, by the caller of the
        readers' `look`.
        """
        self.node.open()
        self.node.wait(timeout)
        self._commands = self.node.publisher(*self.commanded, COMMANDS)
        self.subscriptions = [
            (self.node.subscription(source.name, source.kind, source.qos), source)
            for source in self.inputs.sources()
        ]
        fast = [pair for pair in self.subscriptions if not pair[1].slow]
        slow = [pair for pair in self.subscriptions if pair[1].slow]
        self.readers = [
            Reader(fast, clock=self._clock),
            Reader(slow, SLOW_PAUSE, self._mind_maps, self._clock),
        ]
        if read:
            for reader in self.readers:
                reader.start()

    def state(self) -> State | None:
        """Newest pose."""
        return self.inputs.state(self._clock())

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        """Publish forward speed [m/s], turn rate [rad/s], and an omni's speed to the left [m/s]."""
        if not all(map(math.isfinite, (v, omega, vy))):
            raise ValueError(f"expected finite speeds, got {v}, {omega} and {vy}")
        now = self._clock()
        if v or omega or vy or self._is_wanted():
            self._idle_since = now
        if now - self._idle_since <= QUIET:
            self._publish(v, omega, vy, now)

    def stop(self) -> None:
        """Publish zero."""
        now = self._clock()
        if now - self._idle_since <= QUIET:
            self._publish(0.0, 0.0, 0.0, now)

    def health(self) -> LinkStatus:
        """What is known of the other end: odometry is its heartbeat."""
        now = self._clock()
        state, inputs = self.inputs.state(now), self.inputs
        problems, blind = inputs.problems(now), inputs.blind(now)
        scans = [scan.stamp for scan in inputs.scans]
        return LinkStatus(
            connected=True,
            heartbeat_stamp=now,
            pose_stamp=-math.inf if state is None else state.stamp,
            ready=True,
            pose_ok=not problems,
            faults=problems,
            counters=self.counters(),
            scan_stamp=-math.inf if blind else min(scans, default=None),
            scan_faults=blind,
        )

    def _mind_maps(self, now: float) -> None:
        """Make grids of new maps; ask again for those that were lost among what is no message.

        A map server sends its map once: one that a flood has pushed out would never come again.
        """
        self.inputs.build(now)
        if now - self._asked < ASK_AGAIN:
            return
        self._asked = now
        missing = {grid.name for grid in self.inputs.grids if grid.is_missing}
        for subscription, source in self.subscriptions:
            lost = subscription.malformed > self._malformed.get(source.name, 0)
            if source.qos.transient_local and source.slow and (lost or source.name in missing):
                self._malformed[source.name] = subscription.malformed
                subscription.ask_again()

    @property
    def commanded(self) -> tuple[str, str]:
        """Name and type of the topic of its commands."""
        kind = TWIST_STAMPED if self.options.stamped else TWIST
        kind = ACKERMANN_STAMPED if self.options.wheels.wheelbase else kind
        return self.options.topics["cmd_vel"][0], kind

    @property
    def published(self) -> int:
        """Number of commands that were published."""
        return 0 if self._commands is None else self._commands.count

    def counters(self) -> dict[str, int]:
        """Messages that came, were malformed, or were not believed."""
        inputs, subscriptions = self.inputs, [pair[0] for pair in self.subscriptions]
        return {
            "messages": sum(s.received for s in subscriptions),
            "malformed": sum(s.malformed for s in subscriptions),
            "refused_transforms": inputs.transforms.refused,
            "not_finite": inputs.pose.refused,
            "errors": sum(reader.errors for reader in self.readers),
            **{f"odometry_{name}": n for name, n in inputs.pose.filter.counters.items()},
        }

    def warnings(self) -> tuple[str, ...]:
        """What a user should know once."""
        errors = [s.last_error for s, _ in self.subscriptions if s.malformed == s.received > 0]
        errors += [reader.last_error for reader in self.readers if reader.errors]
        return tuple(text for text in (*errors, self.inputs.refused_goal) if text)

    def close(self) -> None:
        """Leave the network; idempotent."""
        for reader in self.readers:
            reader.stop()
        self.node.close()

    def _publish(self, v: float, omega: float, vy: float, now: float) -> None:
        assert self._commands is not None, "connect comes first"
        stamp, base = self.inputs.clock.stamp(now), self.inputs.pose.base
        wheels = self.options.wheels
        if wheels.wheelbase:
            self._curvature = curvature_of(v, omega, 1.0 / wheels.radius, self._curvature)
            angle = math.atan(wheels.wheelbase * self._curvature)
            message = self.outputs.steered(v, angle, stamp, base)
        else:
            stamped = stamp if self.options.stamped else None
            message = self.outputs.command(v, omega, stamped, base, vy)
        self._commands.publish(message)
