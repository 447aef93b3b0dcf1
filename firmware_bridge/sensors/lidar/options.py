"""The ``[lidar]`` section of a robot file: which lidar, where it is mounted, what counts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from firmware_bridge.link.url import LinkUrl
from firmware_bridge.messages import ConfigError
from firmware_bridge.options import bounded, check, from_table

LIDARS = ("rplidar", "ld06")
NO_RETURN = ("unknown", "free")
SECTORS = 64  # more sectors than this are no robot's


@dataclass(frozen=True)
class LidarOptions:
    """The ``[lidar]`` section."""

    driver: str  # rplidar (SLAMTEC A1, A2) or ld06 (LDROBOT LD06, LD19)
    link: str | None = None
    """serial:PATH, pty:PATH, tcp:HOST:PORT or udp:HOST:PORT; it must be given."""
    mount: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pose of the sensor on the robot: ahead, to the left [m], and where its front points,
    counter-clockwise [rad]."""
    mirrored: bool = False  # whether it hangs upside down
    range_min: float | None = bounded(0.0, 100.0, "m", None)
    """Nearer returns count as unknown [m]; the sensor's own limit if not given."""
    range_max: float | None = bounded(0.05, 1000.0, "m", None)
    """Farther returns count as nothing within reach [m]; the sensor's own limit if not given."""
    ignore: tuple[tuple[float, float], ...] = ()
    """Sectors from, to [rad], counter-clockwise from ahead, in which the sensor sees the robot
    itself: what lies there counts as unknown."""
    beams: int = bounded(36, 1440, "", 360)  # of a scan as the controller takes it
    noise: float = bounded(0.0, 1.0, "m", 0.02)  # standard deviation of a distance [m]
    no_return: str = "unknown"
    """What a beam without a return is: "unknown" (black, mirrors, glass, or nothing near), or
    "free": nothing within reach."""
    returns: float = bounded(0.0, 1.0, "", 0.05)
    """A turn of which a smaller share of beams says something is no scan: the sensor is covered."""
    timeout: float = bounded(0.5, 60.0, "s", 10.0)
    """How long the lidar may take until its first turn [s]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.driver not in LIDARS:
            raise ConfigError(f"driver: expected {', '.join(LIDARS)}, got {self.driver!r}")
        if self.no_return not in NO_RETURN:
            raise ConfigError(f"no_return: expected {' or '.join(NO_RETURN)}, got {self.no_return}")
        if self.link is None:
            raise ConfigError("link: missing: give --lidar-link URL")
        LinkUrl.parse(self.link)
        check(self)
        low, high = self.range_min, self.range_max
        if low is not None and high is not None and low >= high:
            raise ConfigError(f"range_max: expected more than range_min {low:g} m, got {high:g}")

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> LidarOptions:
        """Read the section; ConfigError names the key that is wrong."""
        lists = {"mount", "ignore"}
        options = from_table(cls, {k: v for k, v in table.items() if k not in lists}, "lidar")
        given: dict[str, Any] = {}
        if "mount" in table:
            given["mount"] = _numbers(table["mount"], 3, "mount: expected [x, y, theta] in m, rad")
        if "ignore" in table:
            sectors = table["ignore"]
            if not isinstance(sectors, list | tuple) or len(sectors) > SECTORS:
                raise ConfigError(f"lidar.ignore: expected [[from, to], ...], got {sectors!r}")
            words = "ignore: expected [[from, to], ...] in rad"
            given["ignore"] = tuple(_numbers(sector, 2, words) for sector in sectors)
        return replace(options, **given)


def _numbers(value: object, count: int, words: str) -> tuple[float, ...]:
    numbers = value if isinstance(value, list | tuple) else ()
    good = [
        float(x)
        for x in numbers
        if not isinstance(x, bool) and isinstance(x, int | float) and math.isfinite(x)
    ]
    if len(good) != count or len(numbers) != count:
        raise ConfigError(f"lidar.{words}, got {value!r}")
    return tuple(good)
