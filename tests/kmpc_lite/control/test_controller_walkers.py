"""A pedestrian given as standing that walks is noticed, and driven past as it walks."""

import copy
import math
import pickle

import numpy as np
import pytest
from seen_maps import hit_boxes

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab.studies import pedestrians
from kmpc_lite.control.kernels.records import SPREAD_RATE, VELOCITY, things_of
from kmpc_lite.control.options import TrackerOptions
from kmpc_lite.control.plan import Task
from kmpc_lite.control.safe_motion import SafeMotion, SafeMotions
from kmpc_lite.control.world.tracking import Tracking
from kmpc_lite.control.world.tracks import TrackedCircles
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

DT = 0.1
GOAL = (1.8, 0.0, 0.0)


class Watch(Tracking):
    """Follows circles of which only the list is given."""

    def see(self, state: TrackedCircles, given: Array) -> Array:
        return super().see(state, given).things


def watch() -> Watch:
    return Watch(kl.NavigationProblem(), kl.ControllerOptions())


def walker(k: int, vx: float = 0.0, vy: float = 0.7) -> Array:
    """A pedestrian that is given as standing, and crosses the way."""
    return np.array([[0.9 + vx * DT * k, -1.4 + vy * DT * k, 0.2, 0.0, 0.0]])


def test_circles_that_move_as_given_are_the_same_array() -> None:
    state, looking = TrackedCircles(), watch()
    still = np.array([[0.0, 1.0, 0.2, 0.0, 0.0], [1.0, 1.0, 0.2, 0.3, 0.1]])
    for k in range(20):
        circles = things_of(still)
        circles[:, :2] += DT * k * still[:, 3:]
        given = circles.copy()
        assert looking.see(state, circles) is circles and not len(state.tracks)
        np.testing.assert_array_equal(circles, given)


@pytest.mark.parametrize("speed", [0.3, 0.7, 1.0])
def test_a_pedestrian_given_as_standing_is_noticed_in_half_a_second(speed: float) -> None:
    state, looking = TrackedCircles(), watch()
    for k in range(6):
        seen = looking.see(state, things_of(walker(k, vy=speed)))
    assert seen[0, SPREAD_RATE] > 0.0
    assert seen[0, 4] == pytest.approx(speed, abs=0.1)


def test_a_drive_with_walkers_goes_on_after_a_copy_and_a_pickle() -> None:
    controller, pose = kl.Controller(kl.nominal_unicycle(DT)), np.zeros(3)
    for k in range(12):
        pose = kmpc_lab.DifferentialDrive().step(
            pose, controller.step(pose, GOAL, walker(k)).command, DT
        )
    assert len(controller.state.circles.tracks)
    others = [copy.deepcopy(controller), pickle.loads(pickle.dumps(controller))]
    for k in range(12, 22):
        plan = controller.step(pose, GOAL, walker(k))
        for other in others:
            np.testing.assert_array_equal(other.step(pose, GOAL, walker(k)).inputs, plan.inputs)
        pose = kmpc_lab.DifferentialDrive().step(pose, plan.command, DT)


@pytest.mark.parametrize("angle", [1.6, 2.2, 2.8])
def test_a_pedestrian_that_turned_is_not_taken_to_walk_more_slowly(
    angle: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    speeds, plain, find = list[float](), list[float](), SafeMotions.find

    def note(self: SafeMotions, states: Array, inputs: Array, task: Task) -> SafeMotion:
        speeds.append(float(task.around.turning[:, SPREAD_RATE].max(initial=0.0)))
        plain.append(float(np.hypot(*task.around.things[0, VELOCITY])))
        return find(self, states, inputs, task)

    monkeypatch.setattr(SafeMotions, "find", note)
    controller, pose = kl.Controller(kl.nominal_unicycle(DT)), np.zeros(3)
    place, way = np.array([-0.5, 1.5]), np.array([0.9, 0.0])
    for k in range(25):
        if k == 15:
            way = 0.9 * np.array([math.cos(angle), math.sin(angle)])
        pose = controller.step(pose, GOAL, np.array([[*place, 0.25, 0.0, 0.0]])).states[1]
        place = place + DT * way
    assert min(plain[8:]) < 0.8
    assert min(speeds[8:]) > 0.9


BEAMS = 180
POST = [0.6, 1.6, 0.1, 0.0, 0.0]


def scanned(pose: Array, k: int) -> kl.LaserScan:
    """What a scanner sees of a pedestrian that crosses the way, and of a post."""
    directions = math.tau / BEAMS * np.arange(BEAMS)
    circles = np.vstack([walker(k), POST])
    ranges = World(circles, np.empty((0, 4))).ranges(pose[:2], pose[2] + directions)
    return kl.LaserScan(np.where(ranges > 4.0, np.inf, ranges), 0.0, math.tau / BEAMS, 4.0)


@pytest.mark.parametrize("speed", [0.6, 0.9])
def test_a_pedestrian_coming_straight_to_the_robot_is_known_within_a_second(speed: float) -> None:
    controller, pose = kl.Controller(kl.nominal_unicycle(DT)), np.zeros(3)
    directions = math.tau / BEAMS * np.arange(BEAMS)
    for k in range(8):
        person = np.array([[1.8 - speed * DT * k, 0.0, 0.25, 0.0, 0.0]])
        ranges = World(person, np.empty((0, 4))).ranges(pose[:2], directions)
        ranges[ranges > 4.0] = np.inf
        controller.step(pose, pose, [kl.LaserScan(ranges, 0.0, math.tau / BEAMS, 4.0)])
    tracks = controller.state.circles.tracks
    assert tracks is not None and tracks.walked.max() >= TrackerOptions().begins


def test_a_pedestrian_given_and_seen_counts_once_and_leaves_no_marks_on_the_map() -> None:
    controller, pose = kl.Controller(kl.nominal_unicycle(DT)), np.array([-0.5, 0.0, 0.0])
    for k in range(12):
        told = kl.Circle(*walker(k)[0, :3], vy=0.7)
        controller.step(pose, pose, [scanned(pose, k), told])
    seen = controller.state.seen
    assert seen is not None and controller.state.guide is not None
    low, _ = hit_boxes(seen)
    assert len(low) and (low[:, 1] > 1.0).all()


def test_a_drive_among_pedestrians_attributes_each_contact() -> None:
    row = pedestrians.drive(4, "turning", "zero", 5)
    assert row.arrived and not row.collided and row.more["driven_into"] == 0
