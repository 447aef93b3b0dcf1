"""A scanner that has died, or hangs, is noticed, and the robot does not drive blind."""

from __future__ import annotations

import numpy as np

import kmpc_lite as kl
from kmpc_lite.control.options import SightOptions
from kmpc_lite.control.world.sight.scan_watch import ScanWatch, ScanWatchState
from kmpc_lite.types import Array

HERE = np.zeros(3)


def watch(period: float = 0.1, **options: float) -> ScanWatch:
    return ScanWatch(kl.NavigationProblem(), SightOptions(**options), period)  # type: ignore[arg-type]


def scan(distance: float = 2.0, heading: float = 0.0) -> kl.LaserScan:
    return kl.LaserScan(np.full(36, distance), 0.0, np.pi / 18, 4.0, mount=(0.0, 0.0, heading))


def steps_until_blind(eyes: ScanWatch, scans: list[kl.LaserScan], pose: Array = HERE) -> int:
    state = ScanWatchState()
    eyes.see(state, [scan()], HERE)
    for step in range(1, 100):
        if eyes.see(state, scans, pose)[1]:
            return step
    return 100


def test_a_robot_drives_for_a_second_without_scans() -> None:
    assert steps_until_blind(watch(), []) == 11
    assert steps_until_blind(watch(), [scan(np.nan)]) == 11
    assert steps_until_blind(watch(blind_time=0.5), []) == 6


def test_one_scan_may_be_late_whatever_the_period() -> None:
    assert steps_until_blind(watch(1.0), []) == 3


def test_a_scan_counts_as_told_again_from_half_a_radius_away() -> None:
    radius = kl.NavigationProblem().robot_radius
    for axis, unit in ((0, radius), (1, radius), (2, 1.0)):
        place = np.zeros(3)
        place[axis] = 0.49 * unit
        assert steps_until_blind(watch(), [scan()], place) == 100
        place[axis] = 0.51 * unit
        assert steps_until_blind(watch(), [scan()], place) == 11


def test_what_is_told_again_is_left_out_at_once_and_another_scanner_still_counts() -> None:
    eyes, state, far = watch(), ScanWatchState(), np.array([0.3, 0.0, 0.0])
    hangs, lives = scan(), scan(1.9, heading=1.0)
    assert eyes.see(state, [hangs, lives], HERE)[0] == (hangs, lives)
    for distance in np.linspace(1.8, 1.0, 40):
        lives = scan(float(distance), heading=1.0)
        assert eyes.see(state, [hangs, lives], far) == ((lives,), "")


def test_a_scanner_that_tells_each_half_of_its_turn_by_itself_may_hang_too() -> None:
    random = np.random.default_rng(0)
    ahead, behind = (
        kl.LaserScan(random.uniform(1.0, 3.0, 90), first, np.pi / 90, 8.0)
        for first in (-np.pi / 2, np.pi / 2)
    )
    eyes, state = watch(), ScanWatchState()
    eyes.see(state, [ahead, behind], HERE)
    assert eyes.see(state, [ahead, behind], HERE + (1.0, 0.0, 0.0)) == ((), "")


def test_scanners_whose_beams_are_always_others_are_not_remembered_for_ever() -> None:
    eyes, state = watch(), ScanWatchState()
    for k in range(100):
        turned = kl.LaserScan(np.full(36, 2.0), 1e-3 * k, np.pi / 18, 4.0)
        assert eyes.see(state, [turned], HERE)[0] == (turned,)
    assert len(state.last) == 16


def test_far_and_wide_there_may_be_nothing_for_long() -> None:
    assert steps_until_blind(watch(), [scan(np.inf)], np.array([3.0, 0.0, 0.0])) == 100


def test_seven_hits_may_come_again_along_a_wall() -> None:
    far, ranges = np.array([0.5, 0.0, 0.0]), np.full(36, np.inf)
    for hits, step in ((7, 100), (8, 11)):
        ranges[:hits] = 1.0
        eyes, state = watch(), ScanWatchState()
        told = [kl.LaserScan(ranges, 0.0, np.pi / 18, 4.0)]
        eyes.see(state, told, HERE)
        blind = [bool(eyes.see(state, told, far)[1]) for _ in range(1, 100)]
        assert sum(blind) == 100 - step


def test_who_never_had_a_scan_is_not_blind() -> None:
    state = ScanWatchState()
    assert all(watch().see(state, [], HERE) == ((), "") for _ in range(100))
