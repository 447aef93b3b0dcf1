"""A scanner that has died, or hangs, is noticed, and the robot does not drive blind."""

import numpy as np

import kmpc_lite as kl
from kmpc_lite.control.options import SightOptions
from kmpc_lite.control.world.sight import ScanWatch, ScanWatchState
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


def test_a_scan_counts_as_repeated_from_half_a_radius_away() -> None:
    radius = kl.NavigationProblem().robot_radius
    for axis, unit in ((0, radius), (1, radius), (2, 1.0)):
        place = np.zeros(3)
        place[axis] = 0.49 * unit
        assert steps_until_blind(watch(), [scan()], place) == 100
        place[axis] = 0.51 * unit
        assert steps_until_blind(watch(), [scan()], place) == 11


def test_a_repeated_scan_is_left_out_at_once_and_another_scanner_still_counts() -> None:
    eyes, state, far = watch(), ScanWatchState(), np.array([0.3, 0.0, 0.0])
    hangs, lives = scan(), scan(1.9, heading=1.0)
    assert eyes.see(state, [hangs, lives], HERE)[0] == (hangs, lives)
    for distance in np.linspace(1.8, 1.0, 40):
        lives = scan(float(distance), heading=1.0)
        assert eyes.see(state, [hangs, lives], far) == ((lives,), "")


def test_a_scanner_that_reports_each_half_of_its_turn_by_itself_may_hang_too() -> None:
    random = np.random.default_rng(0)
    ahead, behind = (
        kl.LaserScan(random.uniform(1.0, 3.0, 90), first, np.pi / 90, 8.0)
        for first in (-np.pi / 2, np.pi / 2)
    )
    eyes, state = watch(), ScanWatchState()
    eyes.see(state, [ahead, behind], HERE)
    assert eyes.see(state, [ahead, behind], HERE + (1.0, 0.0, 0.0)) == ((), "")


def test_a_robot_that_never_had_a_scan_is_not_blind() -> None:
    state = ScanWatchState()
    assert all(watch().see(state, [], HERE) == ((), "") for _ in range(100))
