"""`kmpc study limits`: fields, and one drive of a row."""

import numpy as np
import pytest

from kmpc_lab.studies import limits

ROBOT = "1.5 m/s, 1.5 m/s^2, 5 rad/s^2"


@pytest.mark.parametrize("seed", range(5))
def test_fields_have_gaps_that_the_robot_can_drive_through(seed: int) -> None:
    robot = limits.robot_of(ROBOT)
    start, goal, circles = limits.field(robot, 8.0, seed)
    others = np.vstack([circles, (*start[:2], 0.0), (*goal[:2], 0.0)])
    for k, (x, y, radius) in enumerate(circles):
        gaps = np.hypot(*(np.delete(others, k, 0)[:, :2] - (x, y)).T) - radius
        assert (gaps - np.delete(others, k, 0)[:, 2] >= 3.0 * robot.radius - 1e-9).all()


def test_a_drive_of_a_row_is_counted() -> None:
    row = limits.drive(ROBOT, "given", 0.0, 3)
    assert row.arrived and not row.collided and row.stopped + row.feasible < 0.2
    assert row.seconds < 1.5 * row.ideal_seconds
