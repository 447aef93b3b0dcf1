"""Pictures of runs of every kind: whole, to scale, and in agreement with the run."""

import numpy as np
import pytest
from matplotlib.image import imread
from report_page import LIMITS, some

import kmpc_lite as kl
from kmpc_lab import draw_drives
from kmpc_lab.report.picture import drive_picture
from kmpc_lab.report.runs import limits, trace_of


@pytest.mark.parametrize(
    "name",
    some(["reached", "corridor"], ["blind", "moving", "empty", "single", "timeout", "collision"]),
)
def test_pictures_are_whole(runs, name, tmp_path):
    file = tmp_path / "drive.png"
    draw_drives(file, {name: runs[name]})
    pixels = imread(file)[..., :3]
    assert pixels.shape[1] == 810 and pixels.shape[0] > 250
    assert 0.02 < np.mean(pixels.min(axis=2) < 0.9) < 0.9
    # nothing runs over the edge: title, ticks and legend are all inside
    for edge in (pixels[:2], pixels[-2:], pixels[:, :2], pixels[:, -2:]):
        assert (edge == 1.0).all()


def test_the_map_is_to_scale_and_shows_where_the_robot_ended(runs):
    from matplotlib.patches import Circle

    run = runs["collision"]
    figure = drive_picture({"": trace_of(run)}, "")
    figure.draw_without_rendering()
    axes = figure.axes[0]
    origin, east, north = axes.transData.transform([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
    assert east[0] - origin[0] == pytest.approx(north[1] - origin[1], rel=1e-9)
    discs = {
        (round(p.center[0], 6), round(p.center[1], 6), p.radius)
        for p in axes.patches
        if isinstance(p, Circle)
    }
    assert (0.59, 0.0, 0.15) in discs and (1.5, 1.5, 0.15) in discs and (0.0, 0.0, 0.15) in discs
    # 0.29 m between the edges at 0.5 m/s: contact at 0.58 s, seen at the next sub-sample, 0.6 s
    assert run.duration == pytest.approx(0.6)
    assert (0.3, 0.0, 0.15) in discs


def test_commands_are_drawn_with_limits_and_statuses(runs):
    run = runs["blind"]
    figure = drive_picture({"": trace_of(run, **LIMITS)}, "")
    for panel, column in zip(figure.axes[1:3], (0, 1), strict=True):
        lines = [line for line in panel.lines if line.get_linestyle() == ":"]
        levels = {round(float(line.get_ydata()[0]), 9) for line in lines}
        assert levels == {round(LIMITS["u_min"][column], 9), round(LIMITS["u_max"][column], 9)}
        steps = next(patch for patch in panel.patches if hasattr(patch, "get_data"))
        np.testing.assert_array_equal(steps.get_data().values, run.inputs[:, column])
    texts = [t.get_text() for t in figure.legends[0].get_texts()]
    assert f"rest of the last good plan ({run.statuses.count('FALLBACK')})" in texts
    assert f"no usable plan, braking ({run.statuses.count('STOPPED')})" in texts
    with pytest.raises(kl.KmpcError, match="u_max: expected two numbers"):
        limits(run, (-1.0, -1.0), (1.0,))
