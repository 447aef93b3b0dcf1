"""Poses and goals of messages: in which frame, how old, and what is refused."""

import math

import pytest

pytest.importorskip("rosbags", reason="the extra ros2 (rosbags) is not installed")
from ros_inputs import EPOCH, MAKE, NAN, inputs, odometry, transform


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


def test_tf_alone_reports_pose_and_speeds() -> None:
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
