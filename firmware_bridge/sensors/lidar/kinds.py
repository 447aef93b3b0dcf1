"""The lidar of a robot file, built on its link."""

from __future__ import annotations

from firmware_bridge.link import Transport, open_transport
from firmware_bridge.link.url import LinkUrl
from firmware_bridge.sensors.lidar import ld06, rplidar
from firmware_bridge.sensors.lidar.lidar import SerialLidar
from firmware_bridge.sensors.lidar.options import LidarOptions

KINDS: dict[str, type[ld06.Ld06] | type[rplidar.Rplidar]] = {
    "rplidar": rplidar.Rplidar,
    "ld06": ld06.Ld06,
}
"""Those that have a link of their own."""
LINES = {"rplidar": {"baud": rplidar.BAUD, "dtr": 0}, "ld06": {"baud": ld06.BAUD}}
"""What a serial port is set to where the URL does not say. An RPLIDAR's motor turns while DTR is
off."""


def open_lidar(options: LidarOptions) -> SerialLidar:
    """Build a lidar with a link of its own, which is not yet open; ConfigError for a wrong link."""
    return KINDS[options.driver](lidar_transport(options))


def lidar_transport(options: LidarOptions) -> Transport:
    """Build its link."""
    assert options.link is not None
    link = LinkUrl.parse(options.link)
    if link.kind != "serial":
        return open_transport(link.text)
    missing = {k: v for k, v in LINES[options.driver].items() if k not in link.options}
    added = "&".join(f"{name}={value}" for name, value in missing.items())
    return open_transport(link.text + ("&" if link.options else "?") * bool(added) + added)
