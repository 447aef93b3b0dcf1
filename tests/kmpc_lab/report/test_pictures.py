"""Pictures of runs of every kind: whole, to scale, and in agreement with the run."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread
from report_page import FIT, LIMITS, MODEL, Page, some

import kmpc_lite as kl
from kmpc_lab.report import (
    commands_picture,
    errors_picture,
    fit_picture,
    map_picture,
    overlay_picture,
    timing_picture,
    write_pictures,
    write_report,
)


@pytest.mark.parametrize(
    "name",
    some(["reached", "corridor"], ["blind", "moving", "empty", "single", "timeout", "collision"]),
)
def test_pictures_are_whole(runs, name, tmp_path):
    written = write_pictures(
        tmp_path / "new" / "folder", runs[name], FIT if name == "reached" else None, **LIMITS
    )
    names = ["map.png", "commands.png", "errors.png", "timing.png"] + (
        ["fit.png"] if name == "reached" else []
    )
    assert [file.name for file in written] == names and sorted(
        p.name for p in written[0].parent.iterdir()
    ) == sorted(names)
    for file in written:
        pixels = imread(file)[..., :3]
        assert pixels.shape[1] == 810 and pixels.shape[0] > 250
        assert 0.02 < np.mean(pixels.min(axis=2) < 0.9) < 0.9
        # nothing runs over the edge: title, ticks and legend are all inside
        for edge in (pixels[:2], pixels[-2:], pixels[:, :2], pixels[:, -2:]):
            assert (edge == 1.0).all(), f"{file.name} is cut off"


def test_the_map_is_to_scale_and_shows_where_the_robot_hit(runs):
    from matplotlib.patches import Circle

    run = runs["collision"]
    figure = map_picture(run)
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
    crosses = [line for line in axes.lines if line.get_marker() == "X"]
    assert [tuple(line.get_xydata()[0]) for line in crosses] == [pytest.approx((0.44, 0.0))]
    assert axes.get_title(loc="left").startswith("Collision after 0.6 s")
    assert not [
        line for line in map_picture(runs["reached"]).axes[0].lines if line.get_marker() == "X"
    ]


def test_everything_on_the_map_is_in_view(runs):
    for name in ("reached", "moving", "timeout", "corridor"):
        run = runs[name]
        axes = map_picture(run).axes[0]
        low, high = np.array([axes.get_xlim(), axes.get_ylim()]).T
        assert (run.path[:, :2] - run.scenario.radius >= low).all() and (
            run.path[:, :2] + run.scenario.radius <= high
        ).all()
        assert (np.array(run.scenario.goal[:2]) < high).all() and (
            np.array(run.scenario.goal[:2]) > low
        ).all()


def test_commands_are_drawn_with_limits_and_statuses(runs):
    run = runs["blind"]
    speed, turn = commands_picture(run, **LIMITS).axes
    for panel, column in ((speed, 0), (turn, 1)):
        levels = {
            round(float(line.get_ydata()[0]), 9)
            for line in panel.lines
            if line.get_linestyle() == "--"
        }
        assert levels == {round(LIMITS["u_min"][column], 9), round(LIMITS["u_max"][column], 9)}
        steps = next(patch for patch in panel.patches if hasattr(patch, "get_data"))
        np.testing.assert_array_equal(steps.get_data().values, run.inputs[:, column])
    texts = [t.get_text() for t in speed.figure.legends[0].get_texts()]
    assert f"rest of the last good plan ({run.statuses.count('FALLBACK')})" in texts
    assert f"no usable plan, braking ({run.statuses.count('STOPPED')})" in texts
    kept = commands_picture(replace(run, info={"u_min": [-1.0, -2.0], "u_max": [1.0, 2.0]})).axes[1]
    assert {float(line.get_ydata()[0]) for line in kept.lines if line.get_linestyle() == "--"} == {
        -2.0,
        2.0,
    }
    assert not [
        line for line in commands_picture(run).axes[0].lines if line.get_linestyle() == "--"
    ]
    with pytest.raises(kl.KmpcError, match="u_max: expected two numbers"):
        commands_picture(run, (-1.0, -1.0), (1.0,))


def test_errors_and_times_agree_with_the_run(runs):
    run = runs["reached"]
    distance, heading, clearance = errors_picture(run).axes
    curve = clearance.lines[0].get_ydata()
    assert curve[1:].min() == pytest.approx(run.clearance, abs=1e-12)
    assert distance.lines[0].get_ydata()[-1] == pytest.approx(run.position_error)
    assert abs(heading.lines[0].get_ydata()[-1]) == pytest.approx(run.heading_error)
    assert len(errors_picture(runs["empty"]).axes) == 2
    texts = [
        t.get_text()
        for t in timing_picture(replace(run, step_times=np.linspace(1e-3, 3e-3, len(run.inputs))))
        .legends[0]
        .get_texts()
    ]
    assert texts == [
        "half within 2.00 ms (p50)",
        "99 % within 2.98 ms (p99)",
        "all within 3.00 ms (max)",
        "budget: the period, 100 ms",
    ]


def test_fit_errors_come_from_the_report_or_from_the_model(runs, tmp_path, blank):
    widths = [[bar.get_width() for bar in panel.patches] for panel in fit_picture(FIT).axes]
    np.testing.assert_allclose(widths, [[1, 4, 11, 21], [2, 5, 12, 22], [3, 6, 13, 23]])
    diverged = fit_picture(replace(FIT, multi_step=(np.inf,) * 3, nominal_multi_step=(np.inf,) * 3))
    diverged.draw_without_rendering()
    assert [t.get_text() for t in diverged.axes[0].texts] == [
        "1 mm",
        "4 mm",
        "diverged",
        "diverged",
    ]
    kept = replace(
        MODEL,
        info={
            "method": "integral",
            "rank": 18,
            "features": 20,
            "held_out": {**FIT.as_dict(), "one_step": [0.001, 0.002, 0.003]},
        },
    )
    write_report(tmp_path / "kept.html", runs["single"], kept)
    page = Page(tmp_path / "kept.html")
    assert (
        "1234 starts" in page.words
        and "Rank 18 of 20 features" in page.words
        and len(page.svgs()) == 5
    )
    write_report(
        tmp_path / "none.html", runs["single"], replace(MODEL, info={"held_out": {"horizon": 1.0}})
    )
    assert "starts in driving" not in Page(tmp_path / "none.html").words
    write_report(tmp_path / "bare.html", runs["single"])
    assert "The model" not in Page(tmp_path / "bare.html").words


def test_overlay_groups_runs_by_label(runs):
    chosen = [runs["reached"], runs["timeout"], runs["reached"]]
    figure = overlay_picture(chosen, ["ours", "_peer $\\frac{", "ours"])
    figure.draw_without_rendering()
    texts = [t.get_text().strip() for t in figure.legends[0].get_texts()]
    assert texts[:3] == ["ours (2)", "_peer $\\frac{", "out of time"]
    assert figure.axes[0].get_title(loc="left") == "3 runs: 2 reached, 0 collided, 1 out of time"
    with pytest.raises(kl.KmpcError, match="another map"):
        overlay_picture([runs["reached"], runs["empty"]], ["a", "b"])
    with pytest.raises(kl.KmpcError, match="2 runs and 1 labels"):
        overlay_picture([runs["reached"]] * 2, ["a"])
