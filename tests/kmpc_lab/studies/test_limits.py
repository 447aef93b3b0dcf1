"""`kmpc study limits`: fields, and one drive of a row."""

from dataclasses import replace

import numpy as np
import pytest

from kmpc_lab.studies import accelerations

ROBOT = "1.5 m/s, 1.5 m/s^2, 5 rad/s^2"


@pytest.mark.parametrize("seed", range(5))
def test_fields_have_gaps_that_the_robot_can_drive_through(seed: int) -> None:
    robot = accelerations.robot_of(ROBOT)
    start, goal, circles = accelerations.field(robot, 8.0, seed)
    others = np.vstack([circles, (*start[:2], 0.0), (*goal[:2], 0.0)])
    for k, (x, y, radius) in enumerate(circles):
        gaps = np.hypot(*(np.delete(others, k, 0)[:, :2] - (x, y)).T) - radius
        assert (gaps - np.delete(others, k, 0)[:, 2] >= 3.0 * robot.radius - 1e-9).all()


def test_a_drive_of_a_row_is_counted_and_reported() -> None:
    row = accelerations.drive(ROBOT, "given", 0.0, 3)
    assert row.arrived and not row.collided and row.stopped + row.feasible < 0.2
    slower = replace(row, axes=(ROBOT, "learned", row.axes[2]), seconds=2.0 * row.seconds)
    touched = replace(row, collided=True, arrived=False, seed=4)
    table = accelerations.format_rows([row, slower, touched]).splitlines()
    assert len(table) == 4 and table[2].endswith("2.00")
    assert table[-1].endswith("field 4: touched")
