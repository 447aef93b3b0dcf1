"""The [lidar] section: what it holds, and the one line that tells what is wrong."""

import pytest

from firmware_bridge.messages import ConfigError
from firmware_bridge.robot_file import load_robot

BASE = {"driver": "ld06", "link": "serial:/dev/ttyUSB0"}
LINK = {"url": "tcp:127.0.0.1:1", "driver": "mavlink"}


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"driver": "sick"}, "lidar.driver: expected rplidar, ld06, got 'sick'"),
        ({"link": "usb:0"}, "link: expected serial:"),
        ({"link": None}, "lidar.link: missing: give --lidar-link URL"),
        ({"mount": [1, 2]}, "lidar.mount: expected .x, y, theta. in m, rad"),
        ({"ignore": [1, 2]}, "lidar.ignore"),
        ({"ignore": [[0, 1]] * 65}, "lidar.ignore"),
        ({"beams": 10}, "lidar.beams: expected 36 to 1440"),
        ({"no_return": "maybe"}, "lidar.no_return: expected unknown or free"),
        ({"range_min": 2, "range_max": 1}, "lidar.range_max: expected more than range_min"),
    ],
)
def test_what_is_wrong_is_reported_in_one_line(more, words):
    with pytest.raises(ConfigError, match=words) as told:
        table = {k: v for k, v in {**BASE, **more}.items() if v is not None}
        load_robot(None, {"link": LINK, "lidar": table})
    assert "\n" not in str(told.value)


def test_a_lidar_is_named():
    with pytest.raises(ConfigError, match="lidar.driver: missing: give --lidar NAME"):
        load_robot(None, {"link": LINK, "lidar": {"link": "pty:x"}})
    assert load_robot(None, {"link": LINK}).lidar is None
