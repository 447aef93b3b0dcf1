"""What `kmpc run --live` shows: what loop and planner left last, as plain data."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Self

from firmware_bridge.safety.gate_table import DRIVING, Reason

if TYPE_CHECKING:
    from firmware_bridge.integration.course import Course
    from firmware_bridge.live.address import LiveAddress
    from firmware_bridge.live.channel import Packet
    from firmware_bridge.live.moment import LastStep
    from firmware_bridge.messages import LinkStatus
    from firmware_bridge.runtime.session import Session
    from firmware_bridge.runtime.timing import Histogram

MODULE = "firmware_bridge.live.page"
TOLD = 10.0  # how long a refusal is shown [s]
NEVER = 1e3  # what is older was never heard [s]


class Showing:
    """The page on which one run is shown.

    `page`: where; its port is taken at once. `socket`: of the bridge's emergency stop.
    """

    def __init__(self, page: LiveAddress, socket: Any) -> None:
        from firmware_bridge.live.feed import Feed

        self._feed = Feed(page, MODULE, {"socket": str(socket)}, self.hear)
        self.job: Course | None = None  # what is driven, once it is known
        self._heard = ("", "")
        """Of the page's thread: the goal that was clicked last, and why it is refused, if it is."""
        self._last: LastStep | None = None
        """Of the planner's thread: replaced with each plan, never changed."""

    def __enter__(self) -> Self:
        """Begin to serve, and print the links."""
        from firmware_bridge.live.feed import tell_links

        self._feed.__enter__()
        tell_links(self._feed.links)
        return self

    def __exit__(self, *error: object) -> None:
        """Serve no more; say what went wrong meanwhile."""
        self._feed.__exit__(*error)
        if self._feed.problem:
            sys.stderr.write(f"kmpc: {self._feed.problem}\n")

    def saw(self, pose: tuple[float, float, float], plan: Any, scan: Any) -> None:
        """Take a plan, in the thread that has just made it."""
        from firmware_bridge.live.moment import last_step

        assert self.job is not None
        self._last = last_step(self.job.controller, pose, plan, scan)

    def hear(self, word: str) -> None:
        """Take a goal that was clicked on the page, with its token: `goal X Y THETA`."""
        from firmware_bridge.integration.course import beyond

        assert self.job is not None
        x, y, theta = map(float, word.split()[1:])
        refused = beyond(self.job.robot, (x, y, theta))
        if not self.job.navigator.route.clicked:
            refused = "this run takes no goals from the page: kmpc run --click"
        if not refused:
            self.job.navigator.go((x, y, theta))
        self._heard = word, refused

    @contextmanager
    def watch(self, session: Session, job: Course) -> Iterator[None]:
        """Show a session while it drives."""
        from firmware_bridge.live.moment import map_packet

        link, scenario = session.robot.link, job.scenario
        title = f"{scenario.name}: {link.driver} {link.url}"
        route = job.navigator.route
        shown = {**map_packet(scenario, title), "clicks": route.clicked}
        shown["goal"] = None if route.idle else shown["goal"]
        self._feed.start(lambda: self.packet(session), shown)
        yield
        from firmware_bridge.runtime.drive import ending

        ended = ending(job.navigator, session)
        self._feed.say({**self.packet(session), "over": ended["ended"] or ended["outcome"]})

    def packet(self, session: Session) -> Packet:
        """Give what is true now; reads references that others replace, and never waits."""
        from firmware_bridge.live.moment import plan_packet

        shot, step, estop = session.loop.snapshot, self._last, session.estop
        assert self.job is not None
        navigator = self.job.navigator
        packet: Packet = {"latched": estop.latched, "gate": "WAITING", "wrong": []}
        packet.update(heard=list(self._heard), reason=navigator.reason)
        goal = None if navigator.route.idle else navigator.route.goal
        if step is not None and goal is not None:
            packet.update(plan_packet(step, goal))
        if shot is None:
            return packet
        output, state, status = shot.output, shot.state, shot.status
        gate = output.state
        wrong = [reason.value for reason in output.reasons if reason is not Reason.BOARD]
        wrong += [*status.faults, *filter(None, (status.frame_doubt,)), *session.problems()]
        if estop.latched:
            wrong.insert(0, "emergency stop: it holds until the robot is allowed to drive")
        packet.update(
            gate=gate.name,
            gate_text=gate.value,
            wrong=wrong,
            command=[output.v, output.omega],
            time=shot.now - session.loop.began,
            step=_times(session.planner.step_time),
            link={"up": status.connected, "text": _link(status, shot.now)},
        )
        if state is not None:
            packet["pose"] = [state.x, state.y, state.theta]
            packet["pose_age"] = shot.now - state.stamp
            packet["distance"] = goal and math.dist((state.x, state.y), goal[:2])
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
    state, lost = "up" if status.connected else "DOWN", f"{status.lost} bad or lost"
    words = (state, heard, status.mode, armed, lost)
    return ", ".join(filter(None, words))


def _times(times: Histogram) -> dict[str, float]:
    if not times.count:
        return {}
    return {"p50": 1e3 * times.quantile(0.5), "p99": 1e3 * times.quantile(0.99)}
