"""What others see of the node, and ask of it: plan, markers, diagnostics; enable and stop."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Pose, PoseStamped
from nav_msgs.msg import Path
from rclpy.duration import Duration
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import Marker, MarkerArray

from firmware_bridge.ros2.driver import NEWEST, Ros2Driver
from firmware_bridge.runtime.session import Session
from firmware_bridge.safety.gate_table import GateState
from kmpc_lite.control.insight import insight

PERIOD, SLOWER = 0.2, 5  # between two plans [s]; number of plans between two diagnostics
GREEN, BLUE, WHITE = (0.1, 0.7, 0.2, 0.9), (0.1, 0.4, 0.9, 0.6), (1.0, 1.0, 1.0, 0.9)
PALE = (0.1, 0.4, 0.9, 0.1)
HEIGHT, LIFETIME = 0.2, Duration(seconds=2)  # of markers [m]; one that is not sent again vanishes
UNABLE = (GateState.ESTOP, GateState.RELEASED)


class Display:
    """Publishes ``~/plan``, ``~/markers`` and ``/diagnostics``; serves ``~/enable``, ``~/estop``.

    `driver`: whose node publishes. `session`: whose gate is reported, enabled and stopped. `job`:
    whose goal and plans are shown.
    """

    def __init__(self, driver: Ros2Driver, session: Session, job: Any) -> None:
        node = driver.node
        self._driver, self._session, self._navigator = driver, session, job.navigator
        self._controller, self._ticks = job.controller, 0
        self._plan: Any = None
        self._margins: list[float] = []
        job.watchers.append(self.saw)
        self._path = node.create_publisher(Path, "~/plan", NEWEST)
        self._markers = node.create_publisher(MarkerArray, "~/markers", NEWEST)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        node.create_service(SetBool, "~/enable", self._enable)
        node.create_service(Trigger, "~/estop", self._estop)
        node.create_timer(PERIOD, driver._guarded(self.show))

    def saw(self, pose: Sequence[float], plan: Any, scan: Any) -> None:
        """Take a plan, in the thread that has just made it."""
        self._plan, self._margins = plan, insight(self._controller, plan).margins.tolist()

    def show(self) -> None:
        """Publish once."""
        loop, navigator, plan = self._session.loop, self._navigator, self._plan
        shot, idle = loop.snapshot, navigator.route.idle
        if shot is None:
            return
        if plan is not None and not idle:
            poses = [PoseStamped(header=self._header(), pose=_pose(row)) for row in plan.states]
            self._path.publish(Path(header=self._header(), poses=poses))
        why = loop.why()
        words = "; ".join(why) or navigator.reason or ("waits for a goal" if idle else "drives")
        if shot.state is not None:
            at = (shot.state.x, shot.state.y, shot.state.theta)
            self._markers.publish(self._marked(at, None if idle else navigator.route.goal, words))
        self._ticks += 1
        if self._ticks % SLOWER == 1:
            gate = loop.gate.state
            level = DiagnosticStatus.ERROR if gate in UNABLE else DiagnosticStatus.WARN
            values = {"gate": gate.name, **self._driver.health().counters}
            status = DiagnosticStatus(
                level=level if why else DiagnosticStatus.OK,
                name=f"{self._driver.node.get_name()}: safety gate",
                message=words,
                values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
            )
            self._diagnostics.publish(DiagnosticArray(header=self._header(), status=[status]))

    def _marked(self, robot: Sequence[float], goal: Any, words: str) -> MarkerArray:
        """The robot's disc and where it will be with its margins, its goal, and what it does."""
        disc = 2.0 * self._controller.problem.robot_radius
        found = [
            self._marker(0, Marker.CYLINDER, robot, (disc, disc, HEIGHT), BLUE),
            self._marker(1, Marker.TEXT_VIEW_FACING, robot, (0.0, 0.0, HEIGHT), WHITE, words),
        ]
        if goal is not None:
            arrow = (1.5 * disc, 0.25 * disc, 0.25 * disc)
            found.append(self._marker(2, Marker.ARROW, goal, arrow, GREEN))
            rows = [] if self._plan is None else self._plan.states[1:]
            for k, (row, margin) in enumerate(zip(rows, self._margins, strict=False)):
                wide = disc + 2.0 * margin
                found.append(self._marker(3 + k, Marker.CYLINDER, row, (wide, wide, 0.01), PALE))
        return MarkerArray(markers=found)

    def _marker(
        self,
        number: int,
        kind: int,
        place: Sequence[float],
        size: tuple[float, float, float],
        colour: tuple[float, float, float, float],
        text: str = "",
    ) -> Marker:
        marker = Marker(header=self._header(), ns="kmpc", id=number, type=kind, text=text)
        marker.pose, marker.lifetime = _pose(place), LIFETIME.to_msg()
        marker.scale.x, marker.scale.y, marker.scale.z = size
        marker.color.r, marker.color.g, marker.color.b, marker.color.a = colour
        return marker

    def _header(self) -> Header:
        frame = self._driver.options.global_frame
        return Header(stamp=self._driver.node.get_clock().now().to_msg(), frame_id=frame)

    def _enable(self, request: Any, response: Any) -> Any:
        """Let the robot drive, or brake and end as Ctrl-C does."""
        if request.data and self._session.estop.latched:
            response.message = "the emergency stop is pressed: kmpc estop --reset"
            return response
        if request.data:
            self._session.gate.enable()
        else:
            self._session.loop.request_stop("the service ~/enable")
        response.success = True
        return response

    def _estop(self, request: Any, response: Any) -> Any:
        self._session.estop.press()
        response.success, response.message = True, "pressed; kmpc estop --reset lets it drive again"
        return response


def _pose(row: Sequence[float]) -> Pose:
    x, y, theta = map(float, row[:3])
    pose = Pose()
    pose.position.x, pose.position.y = x, y
    pose.orientation.z, pose.orientation.w = math.sin(0.5 * theta), math.cos(0.5 * theta)
    return pose
