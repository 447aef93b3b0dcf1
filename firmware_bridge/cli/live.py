"""What `kmpc run --live` shows: what the loop and the planner left last, made plain data."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from firmware_bridge.safety.gate_table import DRIVING, Reason

if TYPE_CHECKING:
    from firmware_bridge.cli.course import Course
    from firmware_bridge.messages import LinkStatus
    from firmware_bridge.runtime.session import Session
    from firmware_bridge.runtime.timing import Histogram
    from kmpc_lite.live.address import LiveAddress
    from kmpc_lite.live.channel import Packet
    from kmpc_lite.live.feed import Feed
    from kmpc_lite.live.moment import Sight

MODULE = "firmware_bridge.live.page"
NEVER = 1e3
"""What is older was never heard [s]."""


class Page:
    """The page of one run.

    Parameters
    ----------
    address : LiveAddress
        Where it is served; taken at once.
    socket : path
        Of the bridge's emergency stop.
    """

    def __init__(self, address: LiveAddress, socket: Any) -> None:
        from kmpc_lite.live.feed import Feed

        self.feed: Feed = Feed(address, MODULE, {"socket": str(socket)})
        self.controller: Any = None
        """kmpc_lite's, once there is one."""
        self._sight: Sight | None = None
        """Of the planner's thread: replaced with each plan, never changed."""

    def saw(self, pose: tuple[float, float, float], plan: Any) -> None:
        """Take a plan, in the thread that has just made it."""
        from kmpc_lite.live.moment import sight_of

        self._sight = sight_of(self.controller, pose, plan)

    @contextmanager
    def watch(self, session: Session, job: Course) -> Iterator[None]:
        """Show a session while it drives."""
        from kmpc_lite.live.moment import map_packet

        link, scenario = session.robot.link, job.scenario
        title = f"{scenario.name}: {link.driver} {link.url}"
        self.feed.start(lambda: self.packet(session, scenario.goal), map_packet(scenario, title))
        yield
        ended = session.loop.stop_reason or "stopped"
        over = "arrived" if job.navigator.arrived_after is not None else f"ended: {ended}"
        self.feed.say({**self.packet(session, scenario.goal), "over": over})

    def packet(self, session: Session, goal: Any) -> Packet:
        """Give what is true now; reads references that others replace, and waits for nobody."""
        from kmpc_lite.live.moment import plan_packet

        shot, sight, estop = session.loop.snapshot, self._sight, session.estop
        packet: Packet = {"latched": estop.latched, "gate": "WAITING", "wrong": []}
        if sight is not None:
            packet.update(plan_packet(sight, goal))
        if shot is None:
            return packet
        output, state, status = shot.output, shot.state, shot.status
        gate = output.state
        wrong = [reason.value for reason in output.reasons if reason is not Reason.BOARD]
        wrong += [*status.faults, *filter(None, (status.frame_doubt,)), *session.problems()]
        if estop.latched:
            wrong.insert(0, "emergency stop: it holds until somebody lets the robot drive")
        packet.update(
            gate=gate.name,
            gate_text=gate.value,
            wrong=wrong,
            command=[output.v, output.omega],
            time=shot.now - session.loop.started,
            step=_times(session.planner.step_time),
            link={"up": status.connected, "text": _link(status, shot.now)},
        )
        if state is not None:
            packet["pose"] = [state.x, state.y, state.theta]
            packet["pose_age"] = shot.now - state.stamp
            packet["distance"] = math.dist((state.x, state.y), tuple(goal)[:2])
        if session.planner.errors:
            packet["reason"] = session.planner.last_error
        elif gate not in DRIVING:
            packet["reason"] = gate.value
        return packet


def _link(status: LinkStatus, now: float) -> str:
    """Health of the link in words."""
    silent = now - status.heartbeat_stamp
    heard = f"heard {1e3 * silent:.0f} ms ago" if silent < NEVER else "never heard"
    armed = "armed" if status.armed else "not armed"
    bad = sum(
        count
        for name, count in status.counters.items()
        if name.startswith(("bad", "drop", "refused", "reconn"))
    )
    words = ["up" if status.connected else "DOWN", heard, status.mode, armed, f"{bad} bad or lost"]
    return ", ".join(filter(None, words))


def _times(times: Histogram) -> dict[str, float]:
    if not times.count:
        return {}
    return {"p50": 1e3 * times.quantile(0.5), "p99": 1e3 * times.quantile(0.99)}
