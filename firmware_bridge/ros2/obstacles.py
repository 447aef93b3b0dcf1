"""Obstacles of topics: occupancy grids with their updates, and laser scans."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from firmware_bridge.ros2.pose import PoseInput
from firmware_bridge.ros2.transforms import Planar, Transforms, bare, planar, pose_matrix, stamp_of
from firmware_bridge.safety.gate_inputs import GRACE

if TYPE_CHECKING:
    from kmpc_lite.control.world.occupancy import OccupancyGrid
    from kmpc_lite.control.world.scan import LaserScan

LEVEL = 0.97
"""Cosine of the largest tilt of a map or a scanner, 14 degrees: a plane that is tilted farther cuts
the floor's."""
AHEAD = 0.2
"""How far a scan's stamp may lie ahead of the newest odometry's [s]; farther is another clock."""


@dataclass(frozen=True)
class GridOptions:
    """How a map is understood."""

    threshold: float = 65.0
    """From this value on a cell is occupied; 100 for a costmap, whose lower values are inflated."""
    unknown_is_free: bool = False
    longest: float | None = None
    """A map that has not come for so long is not driven by [s]; a map of a map server comes once.
    """


class GridInput:
    """The newest map of one topic.

    Parameters
    ----------
    name : str
        Of the topic.
    frame : str
        Frame in which the robot is driven.
    transforms : Transforms
        Bring the map into it.
    options : GridOptions
        How it is understood.
    """

    def __init__(self, name: str, frame: str, transforms: Transforms, options: GridOptions) -> None:
        self.name, self._frame, self._transforms, self._options = name, frame, transforms, options
        self._cells: NDArray[np.int8] | None = None
        self._info: Any = None
        self._own_frame = frame
        self._changed = False
        self._received = -math.inf
        self.grid: OccupancyGrid | None = None
        self.refused = ""
        """Why the newest map was not taken."""

    @property
    def is_missing(self) -> bool:
        """Whether no map has come that can be one."""
        return self._cells is None

    def take(self, message: Any, now: float) -> None:
        """Take an OccupancyGrid that came at `now` [s]."""
        info, cells = message.info, np.asarray(message.data)
        if not cells.size or cells.size != info.width * info.height:
            self.refused = f"{self.name}: {cells.size} cells, expected {info.width} x {info.height}"
            return
        self._cells = cells.reshape(info.height, info.width).copy()
        self._info, self._own_frame = info, bare(message.header.frame_id) or self._frame
        self._received, self._changed = now, True

    def update(self, message: Any, now: float) -> None:
        """Take an OccupancyGridUpdate: a part of the map."""
        cells, part = self._cells, np.asarray(message.data)
        x, y, width, height = message.x, message.y, message.width, message.height
        inside = (
            cells is not None
            and x >= 0
            and y >= 0
            and x + width <= cells.shape[1]
            and y + height <= cells.shape[0]
        )
        if cells is None or not inside or part.size != width * height:
            self.refused = f"{self.name}: an update that does not lie within the map"
            return
        cells[y : y + height, x : x + width] = part.reshape(height, width)
        self._received, self._changed = now, True

    def build(self, now: float) -> None:
        """Make the grid of the newest cells, which takes long for large maps; never raises."""
        if not self._changed or self._cells is None:
            return
        from kmpc_lite.control.world.occupancy import OccupancyGrid
        from kmpc_lite.errors import ProblemError

        origin = pose_matrix(self._info.origin.position, self._info.origin.orientation)
        found = self._transforms.lookup(self._frame, self._own_frame, now)
        if origin is None or found is None:
            missing = f"no fresh transform {self._frame} -> {self._own_frame} on /tf"
            self.refused = f"{self.name}: {missing if origin is not None else 'no origin'}"
            return
        self._changed = False
        at = planar(found @ origin)
        try:
            if at.upright < LEVEL:
                raise ProblemError("the map is tilted")
            self.grid = OccupancyGrid(
                self._cells,
                float(self._info.resolution),
                at[:3],
                self._options.threshold,
                self._options.unknown_is_free,
            )
            self.refused = ""
        except ProblemError as error:
            self.refused = f"{self.name}: {error}"

    def problem(self, now: float) -> str:
        """Why the robot must not drive by this map, empty if it may."""
        if self.refused:
            return self.refused
        if self.grid is None:
            return f"no map on {self.name} yet"
        longest = self._options.longest
        if longest is not None and now - self._received > longest:
            return f"no map on {self.name} for {now - self._received:.1f} s"
        return ""


class ScanInput:
    """The newest scan of one topic.

    Parameters
    ----------
    name : str
        Of the topic.
    transforms : Transforms
        Say where the scanner sits on the robot.
    pose : PoseInput
        Says the robot's frame, and the time of stamps.
    longest : float
        Past this age of a scan a robot brakes [s]; one that is `GRACE` times as old is not used.
    mount : tuple, optional
        x, y [m] and heading [rad] of the scanner on the robot; of TF if not given.
    """

    def __init__(
        self,
        name: str,
        transforms: Transforms,
        pose: PoseInput,
        longest: float,
        mount: tuple[float, float, float] | None = None,
    ) -> None:
        self.name, self._transforms, self._pose = name, transforms, pose
        self._longest, self._mount = GRACE * longest, mount
        self._message: Any = None
        self.stamp = -math.inf
        """Of the newest scan's last beam, on our clock [s]."""
        self.refused = ""
        """Why the newest scan was not taken."""

    def take(self, message: Any, now: float) -> None:
        """Take a LaserScan that came at `now` [s]."""
        from kmpc_lite.errors import ProblemError

        try:
            scan = _scan(message, (0.0, 0.0, 0.0), False, 0.0)
        except ProblemError as error:
            self.refused = f"{self.name}: {error}"
            return
        last = stamp_of(message.header) + scan.time_increment * (len(scan) - 1)
        stamp = self._pose.local(last, now)
        if stamp > now + AHEAD:
            self.refused = f"{self.name}: stamps lie {stamp - now:.1f} s ahead of the odometry's"
            return
        self.refused = ""
        self._message, self.stamp = message, min(stamp, now)

    def scan(self, at: float, now: float) -> LaserScan | None:
        """Newest scan for a robot whose pose is of the time `at` [s]; None without, or too old."""
        message, mount = self._message, self._place(now)
        if message is None or mount is None or now - self.stamp > self._longest:
            return None
        age = max(0.0, at - self.stamp)
        return _scan(message, mount[:3], mount.upright < 0.0, age)

    def problem(self, now: float) -> str:
        """Why the robot must not drive by this scanner, empty if it may."""
        if self.refused:
            return self.refused
        if self._message is None:
            return f"no scan on {self.name} yet"
        if now - self.stamp > self._longest:
            return f"no scan on {self.name} for {now - self.stamp:.1f} s"
        if self._place(now) is None:
            scanner = bare(self._message.header.frame_id)
            return f"no level transform {self._pose.base} -> {scanner} on /tf"
        return ""

    def _place(self, now: float) -> Planar | None:
        """Where the scanner sits on the robot; None if that is not known, or where it tilts."""
        if self._mount is not None:
            return Planar(*self._mount, 1.0)
        message = self._message
        frame = self._pose.base if message is None else bare(message.header.frame_id)
        found = self._transforms.lookup(self._pose.base, frame or self._pose.base, now)
        place = None if found is None else planar(found)
        return place if place is not None and abs(place.upright) >= LEVEL else None


def _scan(message: Any, mount: tuple[float, float, float], mirrored: bool, age: float) -> LaserScan:
    """Make kmpc_lite's scan; ProblemError where the message tells none."""
    from kmpc_lite.control.world.scan import LaserScan

    return LaserScan(
        message.ranges,
        message.angle_min,
        message.angle_increment,
        message.range_max,
        message.range_min,
        mount,
        mirrored,
        age=age,
        time_increment=max(0.0, float(message.time_increment)),
    )
