"""What counted of a scan, its hits, and the outline of what it saw to be free."""

import numpy as np
import pytest

import kmpc_lite as kl
from firmware_bridge.live.moment import last_step, numbers, plan_packet
from firmware_bridge.recording.drive.seen import counted, outline
from kmpc_lite.control.world.sight.rays import Rays


def looked(scan: kl.LaserScan, footprint: kl.Footprint | None = None):
    """A controller that has driven an arc and then got a scan; its pose, and its plan."""
    problem = kl.NavigationProblem(footprint=footprint)
    controller = kl.Controller(kl.nominal_unicycle(0.1), problem)
    pose, empty = np.zeros(3), np.full(36, np.inf)
    for _ in range(5):
        free = kl.LaserScan(empty, -np.pi, np.pi / 18, 4.0)
        plan = controller.step(pose, (1.5, 1.0, 2.0), [free])
        pose = plan.states[1]
    return controller, pose, controller.step(pose, (1.5, 1.0, 2.0), [scan])


@pytest.mark.parametrize("age", [0.0, 0.13])
def test_a_picture_shows_the_hits_that_the_controller_used(age: float) -> None:
    ranges = np.random.default_rng(0).uniform(0.05, 4.4, 360)
    scan = kl.LaserScan(
        ranges,
        -np.pi,
        np.pi / 180,
        4.0,
        range_min=0.1,
        mount=(0.05, -0.02, 0.4),
        mirrored=True,
        age=age,
        ignore=((1.0, 2.0),),
    )
    controller, pose, plan = looked(scan)
    here, scale = controller.state.seen, controller.scale
    used = Rays(
        scan.with_self_radius(0.15).scaled(scale.length, scale.time),
        here.poses_at(np.array(age / scale.time)),
        0.1,
    )
    packet = plan_packet(last_step(controller, pose, plan, scan), (1.5, 1.0, 2.0))
    shown = np.frombuffer(packet["scan"]).reshape(-1, 2)
    assert 200 < len(shown) < 300 and len(shown) == len(used.hits)
    away = np.hypot(*(shown - used.hits * scale.length).T)
    # shown as measured: the controller counts neighbours on one surface with each other
    assert (away < 1e-9).mean() > 0.9 and away.max() < 2.0 * scan.noise
    assert packet["seen"] != numbers(outline(scan))


def test_hits_within_a_footprint_are_the_robot_itself() -> None:
    ranges = np.full(360, 2.0)
    ranges[:90] = 0.12
    scan = kl.LaserScan(ranges, -np.pi, np.pi / 180, 4.0)
    controller, _, _ = looked(scan, kl.Footprint.rectangle(0.8, 0.3))
    assert len(counted(controller, scan).points) == 270 and len(scan.points) == 360
