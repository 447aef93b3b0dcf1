"""Scans of messages: where the scanner is mounted, how old they are, and what is no scan."""

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the extra ros2 (rosbags) is not installed")
from ros_inputs import EPOCH, MAKE, NAN, inputs, odometry, spoil, transform

from firmware_bridge.ros2.inputs import Inputs


def seeing(**options: Any) -> Inputs:
    here = inputs("map=", **options)
    odometry(here, 10.0, (0.0, 0.0, 0.0), frame="map")
    return here


def scan(stamp: float, frame: str = "laser") -> Any:
    return MAKE.scan(np.array([1.0, np.inf, NAN, 2.0]), 8.0, stamp, frame)


def test_a_scan_its_mount_and_its_age() -> None:
    here = seeing()
    (scanner,) = here.scans
    scanner.take(scan(EPOCH + 9.95), 10.0)
    assert here.blind(10.0) == ("no level transform base_link -> laser on /tf",)
    transform(here, 10.0, "base_link", "laser", (0.1, 0.0, math.pi), static=True)
    assert here.blind(10.0) == ()
    (found,) = here.obstacles(10.1, 10.0)
    assert found.mount == pytest.approx((0.1, 0.0, math.pi)) and not found.mirrored
    assert found.age == pytest.approx(0.15) and len(found) == 4
    assert here.obstacles(10.8, 10.8) is None
    assert here.blind(10.84) == ("no scan on /scan for 0.9 s",)


WRONG: dict[str, dict[str, Any]] = {
    "angle": {"angle_min": NAN},
    "increment": {"angle_increment": math.inf},
    "limits": {"range_max": 0.0},
    "no beams": {"ranges": np.zeros(0, dtype=np.float32)},
    "a million beams": {"ranges": np.ones(10**6, dtype=np.float32)},
    "beams that last for years": {"time_increment": math.inf},
    "the future": {"header.stamp.sec": round(EPOCH) + 13},
}


@pytest.mark.parametrize("what", WRONG)
def test_a_scan_that_is_none_is_reported_in_one_line_and_not_driven_by(what: str) -> None:
    here = seeing()
    here.scans[0].take(spoil(scan(EPOCH + 10.0, "base_link"), WRONG[what]), 10.0)
    (text,) = here.blind(10.0)
    assert text.startswith("/scan: ") and "\n" not in text and len(text) < 250
    # and the next good one is driven by
    here.scans[0].take(scan(EPOCH + 10.05, "base_link"), 10.05)
    assert here.blind(10.05) == ()
