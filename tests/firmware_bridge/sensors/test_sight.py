"""A turn made a scan: motion undone, mount, mirror, limits, sectors; seen from where one plans."""

from __future__ import annotations

import math

import numpy as np
import pytest

from firmware_bridge.messages import State
from firmware_bridge.runtime.controller_thread import unicycle_arc
from firmware_bridge.sensors.lidar.options import LidarOptions
from firmware_bridge.sensors.sight import AHEAD, Sight, Sweep, Trail, compose
from kmpc_lite.scenario.world import World

BEAMS = 360


def options(**more):
    return LidarOptions("ld06", "pty:x", **{"no_return": "free", **more})


def still(ranges, angles=None, **more):
    """Scan of a robot that stands at the origin."""
    angles = -math.tau * np.arange(len(ranges)) / len(ranges) if angles is None else angles
    sweep = Sweep(np.array(angles), np.array(ranges, float), np.full(len(ranges), 5.0), 0.1, 8.0)
    sight = Sight(options(**more), lambda: sweep)
    here = State(0.0, 0.0, 0.0, 0.0, 0.0, 5.0)
    sight.trail.add(here)
    return sight.look(here)


def at(scan, direction):
    """Range in a direction on the robot."""
    turn = math.remainder(direction - scan.mount[2] - scan.angle_min, math.tau) % math.tau
    return scan.ranges[round(turn / scan.angle_increment) % len(scan.ranges)]


def points(scan, pose):
    """Hits in the map, by the formulas of the test's own."""
    hit = np.isfinite(scan.ranges)
    x, y, turn = scan.mount
    px = x + scan.ranges[hit] * np.cos(scan.angles[hit] + turn)
    py = y + scan.ranges[hit] * np.sin(scan.angles[hit] + turn)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return np.column_stack([pose[0] + c * px - s * py, pose[1] + s * px + c * py])


def test_limits_unknown_and_nothing():
    ranges = np.full(BEAMS, 5.0)
    ranges[:4] = (0.05, math.nan, math.inf, 9.0)
    scan = still(ranges, no_return="unknown")
    told = [at(scan, -math.tau * i / BEAMS) for i in range(4)]
    assert np.isnan(told[:2]).all() and told[2:] == [math.inf, math.inf]
    assert at(still(ranges, no_return="free"), -math.tau / BEAMS) == math.inf
    scan = still(ranges, range_min=5.5, range_max=6.0)
    assert math.isnan(at(scan, 1.0)) and (scan.range_min, scan.range_max) == (5.5, 6.0)


def test_sectors_that_see_the_robot_are_unknown():
    scan = still(np.full(BEAMS, 3.0), ignore=((math.pi - 0.2, -math.pi + 0.2),), mount=(0, 0, 1.0))
    assert math.isnan(at(scan, math.pi)) and math.isnan(at(scan, math.pi + 0.15))
    assert at(scan, math.pi + 0.25) == 3.0 and at(scan, math.pi - 0.25) == 3.0
    assert np.isnan(scan.ranges).sum() == pytest.approx(0.4 / math.tau * BEAMS, abs=2)


@pytest.mark.parametrize(("v", "omega"), [(1.0, 0.0), (0.0, 1.5), (0.8, -1.2)])
def test_the_motion_during_a_turn_is_undone(v, omega):
    """A robot that drives sees a round pillar round, and where it is."""
    took, mount = 0.18, (0.1, 0.05, 0.4)
    world = World([(2.0, 0.5, 0.3, 0, 0), (-1.0, -1.0, 0.4, 0, 0), (0.5, 2.0, 0.2, 0, 0)])
    begin = State(0.0, 0.0, 0.3, v, omega, 10.0)
    stamps = 10.0 + took * np.arange(BEAMS) / BEAMS
    poses = [unicycle_arc(begin, v, omega, t - 10.0) for t in stamps]
    places = compose(np.array([(p.x, p.y, p.theta) for p in poses]), mount)
    angles = -math.tau * np.arange(BEAMS) / BEAMS
    ranges = world.ranges(places[:, :2], places[:, 2] + angles)
    sweep = Sweep(angles, np.where(ranges > 8.0, np.nan, ranges), stamps, 0.1, 8.0)
    sight = Sight(options(mount=mount), lambda: sweep)
    for k in range(12):
        state = unicycle_arc(begin, v, omega, 0.02 * k - 0.02)
        sight.on_tick(0.0, state, None, False, False)
    ahead = unicycle_arc(begin, v, omega, 0.5)  # for when the controller plans
    scan = sight.look(ahead)
    found = points(scan, (ahead.x, ahead.y, ahead.theta))
    centres = np.array([(2.0, 0.5, 0.3), (-1.0, -1.0, 0.4), (0.5, 2.0, 0.2)])
    off = np.abs(np.hypot(*(found[:, None] - centres[:, :2]).transpose(2, 0, 1)) - centres[:, 2])
    # a bin is a degree wide: its beam may be half of that beside, which counts where it grazes
    assert len(found) > 60 and np.median(off.min(axis=1)) < 0.006 and off.min(axis=1).max() < 0.08
    raw = points(still(sweep.ranges, sweep.angles, mount=mount), (0.0, 0.0, 0.3))
    if omega:
        wrong = np.abs(
            np.hypot(*(raw[:, None] - centres[:, :2]).transpose(2, 0, 1)) - centres[:, 2]
        )
        assert wrong.min(axis=1).max() > 2.0 * off.min(axis=1).max()


def test_without_a_turn_or_a_pose_there_is_no_scan():
    state = State(0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    assert Sight(options(), lambda: None).look(state) is None
    sweep = Sweep(np.zeros(3), np.ones(3), np.ones(3), 0.1, 8.0)
    assert Sight(options(), lambda: sweep).look(state) is None


def test_between_poses_it_is_interpolated_over_the_seam_of_the_heading_too():
    trail = Trail()
    trail.add(State(0.0, 0.0, 3.0, 0.0, 0.0, 10.0))
    trail.add(State(1.0, 2.0, -3.0, 0.0, 0.0, 10.2))
    (found,) = trail.poses(np.array([10.1]))
    assert found == pytest.approx([0.5, 1.0, math.pi], abs=1e-9)
    assert trail.poses(np.array([9.0]))[0] == pytest.approx([0.0, 0.0, 3.0])


def test_behind_the_last_it_goes_on_for_a_while():
    trail = Trail()
    trail.add(State(1.0, 0.0, 0.0, 0.5, 0.0, 10.0))
    found = trail.poses(np.array([10.1, 10.0 + 10 * AHEAD]))
    assert found[0] == pytest.approx([1.05, 0.0, 0.0]) and found[1, 0] == 1.0 + 0.5 * AHEAD


def test_bad_and_old_poses_are_not_remembered():
    trail = Trail()
    trail.add(None)
    trail.add(State(math.nan, 0.0, 0.0, 0.0, 0.0, 1.0))
    trail.add(State(1.0, 0.0, 0.0, math.nan, 0.0, 2.0))
    trail.add(State(9.0, 0.0, 0.0, 0.0, 0.0, 1.5))
    assert trail.poses(np.array([3.0])).tolist() == [[1.0, 0.0, 0.0]]
