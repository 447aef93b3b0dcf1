"""Poses, obstacles and goals of messages, and whatever else may be on a network."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the extra ros2 (rosbags) is not installed")

from firmware_bridge.emulator.ros2.messages import RobotMessages
from firmware_bridge.emulator.ros2.world import CellMap
from firmware_bridge.ros2.inputs import Inputs
from firmware_bridge.ros2.message_types import GRID_UPDATE, MessageTypes
from firmware_bridge.ros2.obstacles import GridOptions
from firmware_bridge.ros2.options import Ros2Options, read_topics

TYPES = MessageTypes()
MAKE = RobotMessages(TYPES)
EPOCH = 1.7e9
NAN = math.nan


def inputs(*topics: str, **options: Any) -> Inputs:
    return Inputs(Ros2Options(topics=read_topics(topics, "/"), **options))


def odometry(here: Inputs, now: float, pose: Any, stamp: float | None = None, **frames: str) -> Any:
    names = {"frame": "odom", "base": "base_link", **frames}
    stamp = EPOCH + now if stamp is None else stamp
    message = MAKE.odometry(pose, (0.2, 0.1), stamp, names["frame"], names["base"])
    here.pose.take_odometry(message, now)
    return message


def transform(here: Inputs, now: float, parent: str, child: str, pose: Any, **how: bool) -> None:
    message = MAKE.transforms((parent, child, pose), time=EPOCH + now)
    here.transforms.take(message, now, how.get("static", False))


def test_odometry_is_brought_into_the_maps_frame() -> None:
    here = inputs()
    odometry(here, 10.0, (1.0, 0.0, 0.5))
    assert here.state(10.0) is None
    assert "no fresh transform map -> odom" in here.pose.problem(10.0)
    transform(here, 10.0, "map", "odom", (2.0, 3.0, math.pi / 2))
    state = here.state(10.0)
    assert state is not None
    assert (state.x, state.y, state.theta) == pytest.approx((2.0, 4.0, 0.5 + math.pi / 2))
    assert (state.v, state.omega, state.stamp) == (0.2, 0.1, 10.0)
    # a localisation that fell silent is not believed for ever
    assert here.state(11.9) is not None
    assert here.state(12.1) is None


def test_tf_alone_tells_pose_and_speeds() -> None:
    here = inputs("map=", "scan=", pose_from_tf=True)
    here.transforms.take(
        MAKE.transforms(("base_footprint", "base_link", (0.1, 0.0, 0.0)), time=EPOCH), 9.0, True
    )
    for k in range(6):
        now = 10.0 + 0.05 * k
        links = ("odom", "base_footprint", (0.02 * k, 0.0, 0.0)), ("map", "odom", (1.0, 0.0, 0.0))
        here._take_tf(MAKE.transforms(*links, time=EPOCH + now), now)
    state = here.state(10.25)
    assert state is not None
    assert (state.x, state.v, state.omega) == pytest.approx((1.2, 0.4, 0.0))


@pytest.mark.parametrize("value", [NAN, math.inf, 1e300])
@pytest.mark.parametrize("part", ["position", "orientation", "twist"])
def test_odometry_that_is_not_finite_is_refused(part: str, value: float) -> None:
    here = inputs()
    message = MAKE.odometry((0.0, 0.0, 0.0), (0.0, 0.0), EPOCH, "map", "base_link")
    if part == "twist":
        message.twist.twist.linear.x = value
    else:
        getattr(message.pose.pose, part).x = value
    here.pose.take_odometry(message, 10.0)
    assert here.state(10.0) is None and here.pose.refused == 1
    assert here.pose.problem(10.0)


def test_an_orientation_of_zeros_is_refused() -> None:
    here = inputs()
    message = MAKE.odometry((0.0, 0.0, 0.0), (0.0, 0.0), EPOCH, "map", "base_link")
    message.pose.pose.orientation.w = 0.0
    here.pose.take_odometry(message, 10.0)
    assert here.state(10.0) is None


def test_ages_count_from_the_stamp_whatever_the_senders_clock() -> None:
    here = inputs()
    for k in range(20):
        odometry(here, 10.0 + 0.02 * k, (0.0, 0.0, 0.0), 5.0 + 0.02 * k, frame="map")
    # a pose that waited for 0.2 s on the way is 0.2 s old
    odometry(here, 10.6, (0.0, 0.0, 0.0), 5.4, frame="map")
    state = here.state(10.6)
    assert state is not None and state.stamp == pytest.approx(10.4)
    offset = here.clock_offset(10.6)
    assert offset is not None and offset > 1e9


def test_a_stamp_from_the_future_makes_no_pose_younger_than_now() -> None:
    here = inputs()
    for k in range(5):
        odometry(here, 10.0 + 0.02 * k, (0.0, 0.0, 0.0), frame="map")
    odometry(here, 10.1, (0.0, 0.0, 0.0), EPOCH + 1e6, frame="map")
    odometry(here, 10.12, (0.0, 0.0, 0.0), frame="map")
    odometry(here, 10.14, (0.0, 0.0, 0.0), EPOCH - 1e6, frame="map")
    state = here.state(10.14)
    assert state is not None and state.stamp <= 10.14
    # a clock that jumps to and fro is not believed
    for k in range(6):
        odometry(here, 10.2 + 0.02 * k, (0.0, 0.0, 0.0), EPOCH + 1e6 * (-1) ** k, frame="map")
    assert any("clock of the pose source jumps" in text for text in here.problems(10.4))


def map_of(rows: Any, resolution: float = 0.5, frame: str = "map") -> Any:
    cells = CellMap(np.array(rows, dtype=np.int8), resolution, (-1.0, -1.0))
    return MAKE.map(cells, EPOCH, frame)


def test_a_map_its_update_and_its_frame() -> None:
    here = inputs("scan=")
    (grid,) = here.grids
    assert here.problems(10.0) == ("no map on /map yet",)
    grid.take(map_of([[0, 0, 0], [0, 100, 0]]), 10.0)
    here.build(10.0)
    assert here.problems(10.0) == ()
    (found,) = here.obstacles(10.0, 10.0)
    assert found.rectangles.tolist() == [[0.5, 0.5, 1.0, 1.0]] and found.origin == (-1.0, -1.0, 0.0)
    update = TYPES.make(
        GRID_UPDATE,
        header=MAKE.header(EPOCH, "map"),
        x=0,
        y=0,
        width=2,
        height=1,
        data=np.array([100, 100], dtype=np.int8),
    )
    grid.update(update, 11.0)
    here.build(11.0)
    assert here.obstacles(11.0, 11.0)[0].occupied.tolist() == [
        [True, True, False],
        [False, True, False],
    ]
    # a costmap that rolls with the robot lies in the frame of odometry
    grid.take(map_of([[0, 100]], frame="odom"), 12.0)
    here.build(12.0)
    assert "no fresh transform map -> odom" in here.problems(12.0)[0]
    transform(here, 12.0, "map", "odom", (5.0, 0.0, 0.0))
    here.build(12.0)
    assert here.obstacles(12.0, 12.0)[0].origin == pytest.approx((4.0, -1.0, 0.0))


def test_a_costmap_that_falls_silent_stops_the_robot() -> None:
    here = inputs("scan=", grid=GridOptions(threshold=100.0, longest=1.0))
    here.grids[0].take(map_of([[0, 99, 100]]), 10.0)
    here.build(10.0)
    assert here.obstacles(10.0, 10.0)[0].occupied.tolist() == [[False, False, True]]
    assert here.problems(10.9) == ()
    assert here.problems(11.5) == ("no map on /map for 1.5 s",)


def wrong_map(what: str) -> Any:
    message = map_of([[0, 0], [0, 100]])
    if what == "too few cells":
        message.info.height = 3
    elif what == "four billion columns":
        message.info.width = 2**32 - 1
    elif what == "no cells":
        message.info.width = message.info.height = 0
        message.data = np.zeros(0, dtype=np.int8)
    elif what == "value":
        message.data = np.array([0, 0, 0, 101], dtype=np.int8)
    elif what == "resolution":
        message.info.resolution = NAN
    elif what == "origin":
        message.info.origin.position.x = math.inf
    elif what == "orientation":
        message.info.origin.orientation.w = 0.0
    elif what == "tilted":
        message.info.origin.orientation.x = 1.0
        message.info.origin.orientation.w = 0.0
    else:
        assert what == "noise"
        noise = np.random.default_rng(0).integers(0, 2, (600, 600)) * 100
        message = map_of(noise, 0.05)
    return message


@pytest.mark.parametrize(
    "what",
    [
        "too few cells",
        "four billion columns",
        "no cells",
        "value",
        "resolution",
        "origin",
        "orientation",
        "tilted",
        "noise",
    ],
)
def test_a_map_that_is_none_is_told_in_one_line_and_not_driven_by(what: str) -> None:
    here = inputs("scan=")
    here.grids[0].take(wrong_map(what), 10.0)
    here.build(10.0)
    (text,) = here.problems(10.0)
    assert text.startswith("/map: ") and "\n" not in text and len(text) < 250


@pytest.mark.parametrize(("x", "width"), [(-1, 2), (2, 2), (0, 2**31), (0, 1)])
def test_an_update_outside_of_the_map_is_refused(x: int, width: int) -> None:
    here = inputs("scan=")
    here.grids[0].take(map_of([[0, 0, 0]]), 10.0)
    here.build(10.0)
    update = TYPES.make(
        GRID_UPDATE,
        header=MAKE.header(EPOCH, "map"),
        x=x,
        y=0,
        width=width,
        height=1,
        data=np.zeros(2, dtype=np.int8),
    )
    here.grids[0].update(update, 11.0)
    assert here.problems(11.0)


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


def test_a_scanner_upside_down_is_mirrored_and_one_that_tilts_is_refused() -> None:
    for tilt, fine in ((math.pi, True), (0.5, False)):
        here = seeing()
        message = MAKE.transforms(("base_link", "laser", (0.1, 0.0, 0.0)), time=EPOCH)
        turn = message.transforms[0].transform.rotation
        turn.x, turn.w = math.sin(tilt / 2), math.cos(tilt / 2)
        here.transforms.take(message, 10.0, True)
        here.scans[0].take(scan(EPOCH + 10.0), 10.0)
        assert (here.blind(10.0) == ()) == fine
        if fine:
            assert here.obstacles(10.0, 10.0)[0].mirrored


def wrong_scan(what: str) -> Any:
    message = scan(EPOCH + 10.0, "base_link")
    if what == "angle":
        message.angle_min = NAN
    elif what == "increment":
        message.angle_increment = math.inf
    elif what == "limits":
        message.range_max = 0.0
    elif what == "no beams":
        message.ranges = np.zeros(0, dtype=np.float32)
    elif what == "a million beams":
        message.ranges = np.ones(10**6, dtype=np.float32)
    elif what == "beams that last for years":
        message.time_increment = math.inf
    else:
        assert what == "the future"
        message = scan(EPOCH + 13.0, "base_link")
    return message


@pytest.mark.parametrize(
    "what",
    [
        "angle",
        "increment",
        "limits",
        "no beams",
        "a million beams",
        "beams that last for years",
        "the future",
    ],
)
def test_a_scan_that_is_none_is_told_in_one_line_and_not_driven_by(what: str) -> None:
    here = seeing()
    here.scans[0].take(wrong_scan(what), 10.0)
    (text,) = here.blind(10.0)
    assert text.startswith("/scan: ") and "\n" not in text and len(text) < 250
    # and the next good one is driven by
    here.scans[0].take(scan(EPOCH + 10.05, "base_link"), 10.05)
    assert here.blind(10.05) == ()


def test_goals_come_in_any_frame_that_a_transform_leads_to() -> None:
    here = inputs()
    transform(here, 10.0, "map", "odom", (2.0, 0.0, 0.0))
    here.take_goal(MAKE.goal((1.0, 1.0, 0.5), EPOCH, "odom"), 10.0)
    assert here.goal == pytest.approx((3.0, 1.0, 0.5)) and here.goals == 1


@pytest.mark.parametrize("what", ["no frame", "another frame", "nan", "no orientation"])
def test_goals_that_are_none_are_refused_in_one_line(what: str) -> None:
    here = inputs()
    frame = {"no frame": "", "another frame": "moon"}.get(what, "map")
    message = MAKE.goal((1.0, NAN if what == "nan" else 1.0, 0.0), EPOCH, frame)
    if what == "no orientation":
        message.pose.orientation.w = 0.0
    here.take_goal(message, 10.0)
    assert here.goal is None and here.goals == 0
    assert here.refused_goal.startswith("goal refused: ") and "\n" not in here.refused_goal


def test_frames_without_end_and_circles_of_frames() -> None:
    here = inputs()
    links = [(f"f{k}", f"f{k + 1}", (0.0, 0.0, 0.0)) for k in range(2000)]
    here.transforms.take(MAKE.transforms(*links, time=EPOCH), 10.0, False)
    assert here.transforms.refused == 1500
    assert here.transforms.lookup("f0", "f400", 10.0) is None  # deeper than any robot's
    transform(here, 10.0, "f1", "f0", (0.0, 0.0, 0.0))
    assert here.transforms.lookup("map", "f1", 10.0) is None
    for parent, child in (("a", "a"), ("", "a"), ("a", "")):
        transform(here, 10.0, parent, child, (0.0, 0.0, 0.0))
    assert here.transforms.link("a") is None


@pytest.mark.parametrize(
    ("rate", "problem"), [(1.0, ""), (0.5, "0.50 of real time"), (3.0, "3.00 of real time")]
)
def test_simulated_time_runs_about_as_real_time(rate: float, problem: str) -> None:
    here = inputs("map=", "scan=", simulated_time=True)
    assert here.problems(0.0) == ("no simulated time on /clock",)
    for k in range(100):
        here.clock.take(MAKE.clock(rate * 0.02 * k), 0.02 * k)
    found = here.problems(2.0)
    assert (found == ()) if not problem else problem in found[0]
    assert here.problems(3.0) == ("no simulated time on /clock",)


def test_poses_of_simulated_time_are_as_old_as_that_says() -> None:
    here = inputs("map=", "scan=", simulated_time=True)
    for k in range(100):
        now = 50.0 + 0.02 * k
        here.clock.take(MAKE.clock(0.9 * 0.02 * k), now)
        odometry(here, now, (0.0, 0.0, 0.0), 0.9 * 0.02 * k, frame="map")
    state = here.state(52.0)
    assert state is not None and state.stamp == pytest.approx(51.98, abs=1e-6)
    assert here.clock_offset(52.0) is None
