"""What others see of the node: plan, markers and diagnostics, from a thread of its own."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

from firmware_bridge.messages import State
from firmware_bridge.ros2.driver import Ros2Driver
from firmware_bridge.ros2.message_types import DIAGNOSTICS, MARKERS, PATH
from firmware_bridge.ros2.names import PUBLISHER, SUBSCRIPTION, Qos, Seen
from firmware_bridge.ros2.navigator import GoalNavigator
from firmware_bridge.ros2.node import Publisher
from firmware_bridge.ros2.outputs import ERROR, OK, WARN
from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.safety.gate_table import GateState

PERIOD = 0.2
"""Between two plans [s]."""
SLOWER = 5
"""Number of plans between two diagnostics."""
OFFSET = 0.1
"""Smallest difference of clocks that is reported [s]."""


class Telling:
    """Publishes what the node is doing.

    Parameters
    ----------
    driver : Ros2Driver
        Connected.
    navigator : GoalNavigator
        Whose plan is shown.
    loop : ControlLoop
        Whose gate is reported.
    radius : float
        Of the robot [m].
    clock : callable
        Monotonic time [s].
    """

    def __init__(
        self,
        driver: Ros2Driver,
        navigator: GoalNavigator,
        loop: ControlLoop,
        radius: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._driver, self._navigator, self._loop = driver, navigator, loop
        self._radius, self._clock = radius, clock
        self._publishers: dict[str, Publisher] = {}
        for role, kind in (("plan", PATH), ("markers", MARKERS), ("diagnostics", DIAGNOSTICS)):
            if (name := driver.options.topic(role)) is not None:
                depth = 10 if role == "diagnostics" else 1
                self._publishers[role] = driver.node.publisher(name, kind, Qos(depth=depth))
        self._quit = threading.Event()
        self._thread = threading.Thread(target=self._run, name="ros2-telling", daemon=True)
        self._others: tuple[str, ...] = ()
        self.last_error = ""

    def start(self) -> None:
        """Begin, in a daemon thread."""
        self._thread.start()

    def stop(self) -> None:
        """Publish no more."""
        self._quit.set()
        if self._thread.is_alive():
            self._thread.join(1.0)

    def warnings(self) -> tuple[str, ...]:
        """What a user should know: topics of another type, and clocks that differ."""
        offset = self._driver.inputs.clock_offset(self._clock())
        if offset is None or abs(offset) < OFFSET:
            return self._others
        behind = "behind" if offset > 0 else "ahead of"
        return (*self._others, f"the odometry's clock is {abs(offset):.2f} s {behind} ours")

    def tell(self, diagnostics: bool) -> None:
        """Publish once; never raises."""
        now = self._clock()
        stamp, outputs = self._driver.inputs.clock.stamp(now), self._driver.outputs
        plan, shot = self._navigator.plan, self._loop.snapshot
        try:
            if plan is not None and "plan" in self._publishers:
                self._publishers["plan"].publish(outputs.path(plan.states, stamp))
            if shot is not None and shot.state is not None and "markers" in self._publishers:
                goal, at = self._navigator.goal, _place(shot.state)
                said = self._navigator.said
                self._publishers["markers"].publish(
                    outputs.markers(at, self._radius, goal, said, stamp)
                )
            if diagnostics and shot is not None and "diagnostics" in self._publishers:
                level, text, values = self._summary(now)
                name = f"{self._driver.node.options.name}: safety gate"
                self._publishers["diagnostics"].publish(
                    outputs.diagnostics(name, level, text, values, stamp)
                )
        except Exception as error:  # what is only shown must not end
            self.last_error = f"{type(error).__name__}: {error}"

    def _summary(self, now: float) -> tuple[int, str, dict[str, Any]]:
        """Level, words and values of the diagnostics."""
        why = self._loop.why()
        gate, state = self._loop.gate.state, self._driver.state()
        level = OK if not why else WARN
        if gate in (GateState.ESTOP, GateState.RELEASED):
            level = ERROR
        offset = self._driver.inputs.clock_offset(now)
        values = {
            "gate": gate.name,
            "pose_age_s": "none" if state is None else round(now - state.stamp, 3),
            "clock_offset_s": "none" if offset is None else round(offset, 3),
            "goals_reached": self._navigator.reached,
            **self._driver.counters(),
        }
        return level, "; ".join(why) or self._navigator.said, values

    def _run(self) -> None:
        count = 0
        while not self._quit.wait(PERIOD):
            self.tell(count % SLOWER == 0)
            if count % (4 * SLOWER) == 0:
                self._look()
            count += 1

    def _look(self) -> None:
        """See whether others publish, or hear, one of our topics with another type than ours."""
        sources = self._driver.inputs.sources()
        wanted = {(PUBLISHER, source.name): source.kind for source in sources}
        name, kind = self._driver.commanded
        wanted[SUBSCRIPTION, name] = kind
        try:
            seen = self._driver.node.seen()
        except Exception as error:  # a network that goes away is no reason to end
            self.last_error = f"{type(error).__name__}: {error}"
            return
        self._others = tuple(sorted({self._differs(s, wanted) for s in seen} - {""}))[:4]

    def _differs(self, seen: Seen, wanted: dict[tuple[str, str], str]) -> str:
        """What is wrong with how another node publishes, or hears, one of our topics."""
        kind = wanted.get((seen.entity, seen.topic))
        if kind is None:
            return ""
        how = "published" if seen.entity == PUBLISHER else "heard"
        if seen.kind != kind:
            return f"{seen.topic} is {how} as {seen.kind}, expected {kind}"
        if seen.type_hash != self._driver.node.types.type_hash(kind):
            return f"{seen.topic} is {how} by another distribution of ROS: see --distro"
        return ""


def _place(state: State) -> tuple[float, float, float]:
    return state.x, state.y, state.theta
