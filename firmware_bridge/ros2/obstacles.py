"""Obstacles of topics: occupancy grids with their updates, and laser scans."""

from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING, Any

import numpy as np

from firmware_bridge.ros2.geometry import LEVEL, Lookup, Place, place_of
from firmware_bridge.ros2.options import Ros2Options
from firmware_bridge.safety.gate_table import GRACE

if TYPE_CHECKING:
    from kmpc_lite.control.world.occupancy import OccupancyGrid
    from kmpc_lite.control.world.scan import LaserScan

AHEAD = 0.2
"""How far a scan's stamp may lie ahead of the newest odometry's [s]; farther is another clock."""


class GridInput:
    """The newest map of one topic.

    `name`: of the topic. `options`: how it is understood. `lookup`: see `Lookup`.
    """

    def __init__(self, name: str, options: Ros2Options, lookup: Lookup) -> None:
        self.name, self._options, self._lookup = name, options, lookup
        self._lock = threading.Lock()
        self._cells: Any = None
        self._info: Any = None
        self._own_frame = options.global_frame
        self._changed = False
        self._received = -math.inf
        self.grid: OccupancyGrid | None = None
        self.refused = ""  # why the newest map was not taken

    def take(self, message: Any, now: float) -> None:
        """Take an OccupancyGrid that came at `now` [s]."""
        info, cells = message.info, np.array(message.data, np.int8)
        if not cells.size or cells.size != info.width * info.height:
            self.refused = f"{self.name}: {cells.size} cells, expected {info.width} x {info.height}"
            return
        with self._lock:
            self._cells, self._info = cells.reshape(info.height, info.width), info
            self._own_frame = message.header.frame_id or self._options.global_frame
            self._received, self._changed = now, True

    def update(self, message: Any, now: float) -> None:
        """Take an OccupancyGridUpdate: a part of the map."""
        x, y, width, height = message.x, message.y, message.width, message.height
        part = np.array(message.data, np.int8)
        with self._lock:
            cells = self._cells
            room = (0, 0) if cells is None else cells.shape
            inside = x >= 0 and y >= 0 and x + width <= room[1] and y + height <= room[0]
            if not inside or part.size != width * height:
                self.refused = f"{self.name}: an update that does not lie within the map"
                return
            cells[y : y + height, x : x + width] = part.reshape(height, width)
            self._received, self._changed = now, True

    def build(self) -> None:
        """Make the grid of the newest cells, if they are new; takes long for large maps."""
        from kmpc_lite.control.world.occupancy import OccupancyGrid
        from kmpc_lite.errors import ProblemError

        with self._lock:
            if not self._changed:
                return
            own, frame, options = self._own_frame, self._options.global_frame, self._options
            origin = place_of(self._info.origin.position, self._info.origin.orientation)
            found = self._lookup(frame, own)
            if origin is None or found is None:
                missing = f"no fresh {frame} -> {own} in TF" if origin else "no origin"
                self.refused = f"{self.name}: {missing}"
                return
            self._changed, at = False, found.of(origin)
            try:
                if at.upright < LEVEL:
                    raise ProblemError("the map is tilted")
                cells, side = self._cells.copy(), float(self._info.resolution)
                threshold, free = options.map_threshold, options.unknown_is_free
                self.grid = OccupancyGrid(cells, side, at[:3], threshold, free)
                self.refused = ""
            except ProblemError as error:
                self.refused = f"{self.name}: {error}"

    def problem(self, now: float) -> str:
        """Why the robot must not drive by this map, empty if it may."""
        if self.refused:
            return self.refused
        if self.grid is None:
            return f"no map on {self.name} yet"
        age = now - self._received
        late = 0.0 < self._options.map_age < age
        return f"no map on {self.name} for {age:.1f} s" if late else ""


class ScanInput:
    """The newest scan of one topic.

    `name`: of the topic. `mount`: x, y [m] and heading [rad] of the scanner on the robot; of TF if
    not given. `longest`: past this age of a scan a robot brakes [s]; one that is `GRACE` times as
    old is not used. `lookup`: see `Lookup`.
    """

    def __init__(
        self, name: str, mount: tuple[float, ...] | None, longest: float, lookup: Lookup
    ) -> None:
        self.name, self._longest, self._lookup = name, GRACE * longest, lookup
        self._mount = None if mount is None else Place(*mount)
        self._message: Any = None
        self._place: Place | None = None
        self.stamp = -math.inf  # of the newest scan's last beam, on our clock [s]
        self.refused = ""  # why the newest scan was not taken

    def take(self, message: Any, first: float, base: str, now: float) -> None:
        """Take a LaserScan that came at `now`, whose first beam is of the time `first` [s].

        `base`: the robot's own frame.
        """
        from kmpc_lite.errors import ProblemError

        try:
            scan = _scan(message, Place(0.0, 0.0, 0.0), 0.0)
        except ProblemError as error:
            self.refused = f"{self.name}: {error}"
            return
        stamp = first + scan.time_increment * (len(scan) - 1)
        own = message.header.frame_id or base
        place = self._lookup(base, own) if self._mount is None else self._mount
        if stamp > now + AHEAD:
            self.refused = f"{self.name}: stamps lie {stamp - now:.1f} s ahead of the odometry's"
        elif place is None or abs(place.upright) < LEVEL:
            self.refused = f"{self.name}: no level {base} -> {own} in TF, and no scan_mount"
        else:
            self.refused, self._place = "", place
            self._message, self.stamp = message, min(stamp, now)

    def scan(self, at: float, now: float) -> LaserScan | None:
        """Newest scan for a robot whose pose is of the time `at` [s]; None without, or too old."""
        message, place = self._message, self._place
        if message is None or place is None or now - self.stamp > self._longest:
            return None
        return _scan(message, place, max(0.0, at - self.stamp))

    def problem(self, now: float) -> str:
        """Why the robot must not drive by this scanner, empty if it may."""
        if self.refused or self._message is None:
            return self.refused or f"no scan on {self.name} yet"
        age = now - self.stamp
        return f"no scan on {self.name} for {age:.1f} s" if age > self._longest else ""


def _scan(message: Any, place: Place, age: float) -> LaserScan:
    """Make kmpc_lite's scan; ProblemError if the message is none."""
    from kmpc_lite.control.world.scan import LaserScan

    return LaserScan(
        message.ranges,
        message.angle_min,
        message.angle_increment,
        message.range_max,
        message.range_min,
        place[:3],
        place.upright < 0.0,
        age=age,
        time_increment=max(0.0, float(message.time_increment)),
    )
