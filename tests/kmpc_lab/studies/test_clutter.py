"""The study of clutter: its worlds, the public files, its metric and its drivers."""

from pathlib import Path

import numpy as np
import pytest

from kmpc_lab.sim.maps import has_passage
from kmpc_lab.studies import clutter
from kmpc_lab.studies.clutter import CONDITIONS, SIZE, draw_field, draw_moving, of_places, read_barn
from kmpc_lite.errors import DataError
from kmpc_lite.model.koopman import nominal_unicycle

YARD = [(-4.575 + 0.15 * k, 0.075) for k in range(31)]  # the wall behind the start


@pytest.mark.parametrize("seed", [0, 10, 500_007])
def test_fields_follow_from_the_seed_and_have_a_way_through(seed: int) -> None:
    world, again = draw_field(seed), draw_field(seed)
    circles = world.circles_at(0.0)
    np.testing.assert_array_equal(circles, again.circles_at(7.0))
    # by the passage of other studies' maps, and for the circle about the robot
    radius = 0.5 * float(np.hypot(*SIZE))
    args = circles, world.start, world.goal, radius
    assert has_passage(*args, np.array(world.bounds), cell=0.025)
    assert world.length >= 10.0 - 0.1


def test_a_public_world_is_read(tmp_path: Path) -> None:
    model = "<model name='unit_cylinder_{}'>\n<pose frame=''>{} {} 0 0 0 0</pose>"
    text = "".join(model.format(i, x, y) for i, (x, y) in enumerate([*YARD, (-1.5, 7.575)]))
    state = "<state><model name='unit_cylinder_9'><pose frame=''>9 9 0 0 0 0</pose></state>"
    (tmp_path / "world_6.world").write_text(text + state)
    world = read_barn(tmp_path, 6)
    assert len(world.circles_at(0.0)) == len(YARD) + 1
    assert world.length == pytest.approx(10.0, abs=0.1)
    (tmp_path / "path_files").mkdir()
    np.save(tmp_path / "path_files" / "path_6.npy", np.array([(15, 0), (19, 29)]))
    steps = [(-2.25, 3.0), (-2.325, 5.075), (-1.725, 9.425), (-2.25, 13.0)]
    length = sum(
        float(np.hypot(*np.subtract(b, a))) for a, b in zip(steps, steps[1:], strict=False)
    )
    assert read_barn(tmp_path, 6).length == pytest.approx(length)


def test_public_worlds_that_cannot_be_driven_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        read_barn(tmp_path, 1)
    (tmp_path / "world_1.world").write_text("<sdf/>")
    with pytest.raises(DataError, match="got none"):
        read_barn(tmp_path, 1)
    closed = [(x, 7.575) for x in np.arange(-6.675, 2.25, 0.15)]
    assert of_places("closed", np.array([*YARD, *closed])) is None


def test_moving_cylinders_keep_their_pace_and_begin_apart() -> None:
    world = draw_moving(2)
    before, after = world.circles_at(3.0), world.circles_at(3.001)
    speeds = np.hypot(*before[:, 3:].T)
    assert (speeds > 0.49).all() and (speeds < 1.51).all()
    moved = np.hypot(*(after[:, :2] - before[:, :2]).T) / 0.001
    assert np.isclose(moved, speeds).mean() > 0.9
    assert np.hypot(*(world.circles_at(0.0)[:, :2] - world.start[:2]).T).min() > 3.0


@pytest.mark.parametrize("driver", ["ours", "dwa"])
def test_drivers_go_round_a_few_cylinders(driver: str, monkeypatch: pytest.MonkeyPatch) -> None:
    world = of_places("easy", np.array([*YARD, (-2.325, 6.075), (-2.475, 6.075), (-1.875, 8.075)]))
    assert world is not None
    monkeypatch.setattr(clutter, "model_of", lambda *_: nominal_unicycle(clutter.JACKAL.dt))
    row = clutter.judge(driver, world, CONDITIONS["noisy"], 1)
    assert row.arrived and not row.collided
    # nine metres at 2 m/s with a ramp, or at 1 m/s
    assert row.seconds < 9.0


def test_the_score_is_half_a_point_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clutter, "world_of", lambda *_: of_places("free", np.array(YARD)))
    row = clutter.drive("field", "exact", "dwa", 0)
    assert row.arrived and row.more["score"] == 0.5 and row.seconds < 10.0 and row.peer
