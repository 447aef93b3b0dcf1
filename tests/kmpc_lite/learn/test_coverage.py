"""What a log shows of a robot's ways of driving, and what is said of what it lacks."""

import numpy as np
import pytest

from kmpc_lite.learn.coverage import find_coverage

DT = 0.1
LIMITS = (0.5, 0.5, 1.0)


def held(*commands: tuple[float, float, float]) -> np.ndarray:
    """Commands v, omega, each held for so long [s]."""
    return np.vstack([np.tile([v, omega], (round(s / DT), 1)) for v, omega, s in commands])


def quadrants(v: float = 0.5, omega: float = 1.0, back: bool = True) -> list[np.ndarray]:
    """All that a complete log needs, at these largest speeds."""
    ways = (1.0, -1.0) if back else (1.0,)
    turns = [(s * 0.5 * v, t * 0.5 * omega, 8.0) for s in ways for t in (1.0, -1.0)]
    dashes = [(s * v, 0.0, 8.0) for s in ways] + [(0.0, 0.0, 1.0)]
    spots = [(0.0, omega, 4.0), (0.0, -omega, 4.0)]
    return [held(*turns, *dashes, *spots, *dashes, *turns)]


@pytest.mark.parametrize("scale", [0.1, 1.0, 8.0])
def test_a_log_that_shows_every_way_of_driving_is_complete_whatever_the_robots_speed(scale: float):
    limits = 0.5 * scale, 0.5 * scale, 1.0
    coverage = find_coverage(quadrants(v=0.5 * scale), DT, limits)
    assert coverage.is_complete and coverage.missing == () and coverage.warnings() == []
    assert set(coverage.as_dict().values()) == {1.0}


def test_each_lack_is_named_once_with_what_mends_it() -> None:
    (whole,) = quadrants()
    stretch = [whole[whole[:, 1] >= 0.0]] * 2
    coverage = find_coverage(stretch, DT, LIMITS)
    assert {p.name for p in coverage.missing} == {"right"}
    assert any("turn right" in line for line in coverage.advice())
    assert any("never turns right" in line for line in coverage.warnings())


def test_a_robot_that_must_not_reverse_need_not_show_it() -> None:
    drive = quadrants(back=False) * 2
    assert find_coverage(drive, DT, (0.5, 0.0, 1.0)).is_complete
    assert "reverse" in {p.name for p in find_coverage(drive, DT, LIMITS).missing}


def test_a_log_that_only_drives_wide_turns_says_how_wide() -> None:
    drive = [held((0.5, 1.0, 20.0), (-0.5, -1.0, 20.0), (0.2, 0.4, 20.0), (0.0, 0.0, 1.0))] * 2
    told = [line for line in find_coverage(drive, DT, LIMITS).warnings() if "on the spot" in line]
    assert len(told) == 1 and "nor tighter than on 0.5 m" in told[0] and "a car" in told[0]
