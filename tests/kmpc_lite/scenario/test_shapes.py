"""Polygons, walls and grids in scenario files, in drives and on pictures."""

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.closed_loop import Outcome, drive
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.world import obstacle_gaps

ROBOT = "[robot]\nradius = 0.15\nstart = [-1.0, -1.0, 0.0]\ngoal = [1.0, 1.0, 0.0]\n"


def scenario(content: str, where: str = "text") -> Scenario:
    """Scenario of a map's further keys."""
    return Scenario.from_table(
        tomllib.loads(f"[map]\nbounds = [-2.0, -2.0, 2.0, 2.0]\n{content}\n{ROBOT}"), "field", where
    )


def test_shapes_are_read_and_survive_being_written() -> None:
    text = """polygons = [[[0, 0], [1, 0], [0, 1]]]
walls = [[-1, 1, 1, 1.5], [1, -1, 1, 0, 0.1]]
[map.grid]
resolution = 0.5
origin = [-1.5, 0.0, 0.1]
unknown_is_free = true
rows = ["#.?", "..."]
"""
    first = scenario(text)
    again = Scenario.from_table(tomllib.loads(first.to_toml()), "field", "text")
    for read in (first, again):
        assert read.polygons == (kl.Polygon([(0, 0), (1, 0), (0, 1)]),)
        assert read.walls == (kl.Wall(-1, 1, 1, 1.5), kl.Wall(1, -1, 1, 0, 0.1))
        assert read.grid == kl.OccupancyGrid(
            [[0, 0, 0], [100, 0, -1]], 0.5, (-1.5, 0.0, 0.1), unknown_is_free=True
        )
        assert read.obstacle_count == 4
        assert len(read.obstacles_at(0.0)) == 4
    assert scenario("").solids is None and isinstance(scenario("").obstacles_at(0.0), np.ndarray)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("polygons = 1", "polygons: expected a list"),
        ("polygons = [[[0, 0], [1, 0]]]", "polygon 0: .*at least 3"),
        ("walls = [[0, 0, 1, 1, -0.1]]", "wall 0: .*thickness"),
        ("walls = [[0, 0, 1, true]]", "wall 0: expected"),
        ("grid = {rows = ['#']}", "grid: expected the path of a map.yaml, or a table"),
        ("grid = {resolution = 0.1, rows = ['##', '#']}", "rows: expected strings of one length"),
        ("grid = {resolution = 0.1, rows = ['#x']}", "got 'x'"),
    ],
)
def test_what_is_wrong_is_named_in_one_line(content: str, words: str) -> None:
    with pytest.raises(kl.ScenarioError, match=words) as refused:
        scenario(content)
    assert "\n" not in str(refused.value)


class Straight:
    """Drives straight ahead and looks at nothing."""

    def step(self, x: Any, goal: Any, obstacles: Any = ()) -> kl.Plan:
        return replace(
            kl.Controller(kl.nominal_unicycle(0.1)).step(x, (1.9, 0.0, 0.0)),
            command=np.array([0.6, 0.0]),
        )


@pytest.mark.parametrize(
    "map_",
    [
        {"polygons": (kl.Polygon([(0.5, -0.5), (1.0, -0.5), (1.0, 0.5), (0.5, 0.5)]),)},
        {"walls": (kl.Wall(0.55, -0.5, 0.55, 0.5, 0.1),)},
        {"grid": kl.OccupancyGrid(np.ones((10, 2)), 0.1, (0.5, -0.5), threshold=1)},
    ],
)
def test_a_collision_is_found_at_the_sub_sample(map_: dict[str, Any]) -> None:
    field = Scenario("field", (-2, -2, 2, 2), (), 0.15, (-1.005, 0.0, 0.0), (1.9, 0.0, 0.0), **map_)
    run = drive(Straight(), field)
    # 1.355 m at 0.6 m/s
    assert run.outcome is Outcome.COLLISION and run.duration == pytest.approx(2.275)
    assert -0.03 < run.clearance < 0.0
    np.testing.assert_allclose(
        obstacle_gaps(field, run.path[:, :2], np.zeros(len(run.path)))[1:].min(), run.clearance
    )


def test_pictures_show_solids(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    from matplotlib.collections import PolyCollection

    from kmpc_lab import draw_drives
    from kmpc_lab.report.picture import drive_picture
    from kmpc_lab.report.runs import trace_of

    field = scenario(
        "polygons = [[[0, -1], [1, -1], [0, 0]]]\nwalls = [[-1, 1, 0, 1.5, 0.1]]\n"
        "grid = {resolution = 0.25, origin = [-1.5, 0.0, 0.3], rows = ['#..#', '....']}"
    )
    run = drive(
        kl.Controller(kl.nominal_unicycle(0.1), field.problem()), replace(field, timeout=1.0)
    )
    axes = drive_picture({"": trace_of(run)}, "").axes[0]
    drawn = [it for it in axes.collections if isinstance(it, PolyCollection)]
    shapes = [path.vertices for collection in drawn for path in collection.get_paths()]
    # a polygon, a wall with round ends, and two rectangles
    assert sorted(len(v) for v in shapes)[:3] == [4, 5, 5] and len(shapes) == 4
    corners = np.concatenate([v for v in shapes if len(v) == 5])
    np.testing.assert_allclose(field.solids.whole.least(corners), 0.0, atol=1e-9)  # type: ignore[union-attr]
    with pytest.raises(kl.KmpcError, match="another map"):
        other = replace(run, scenario=replace(field, walls=()))
        draw_drives(tmp_path / "two.png", {"a": run, "b": other})
