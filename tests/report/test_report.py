"""Pictures and report of runs of every kind: what they say, and what they must never do."""

import json
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
from base64 import b64decode
from dataclasses import fields, replace
from html.parser import HTMLParser

import matplotlib
import numpy as np
import pytest
from matplotlib.image import imread

import kmpc_lite as kl
from kmpc_lite.report import (
    commands_picture,
    errors_picture,
    fit_picture,
    map_picture,
    overlay_picture,
    timing_picture,
    write_pictures,
    write_report,
)
from kmpc_lite.report.player import script
from kmpc_lite.report.style import render, write_picture
from kmpc_lite.sim import Outcome, Run, Scenario, drive

MODEL = kl.nominal_unicycle(0.1)
LIMITS = {"u_min": (-0.6, -np.pi / 4), "u_max": (0.6, np.pi / 4)}
FIT = kl.FitReport(
    1.0,
    1234,
    (0.001, 0.002, 0.003),
    (0.011, 0.012, 0.013),
    (0.004, 0.005, 0.006),
    (0.021, 0.022, 0.023),
    5.55,
)
HOSTILE = "<script>alert(1)</script>\"'& $\\frac{ \udce9"


class Straight:
    """Drives straight ahead at 0.5 m/s, whatever stands there."""

    def step(self, x, goal, obstacles=()):
        inputs = np.tile((0.5, 0.0), (20, 1))
        return kl.Plan(
            inputs[0],
            MODEL.rollout(x, inputs),
            inputs,
            kl.PlanStatus.FEASIBLE,
            1,
            {"total": 2e-3},
        )


class Blind:
    """Our controller behind a sensor that fails for a while."""

    def __init__(self, controller):
        self.controller, self.count = controller, 0

    def step(self, x, goal, obstacles=()):
        self.count += 1
        return self.controller.step(
            np.full(3, np.nan) if 14 <= self.count < 24 else x, goal, obstacles
        )


def a_run(scenario, controller=None, **info):
    return drive(controller or kl.Controller(MODEL, scenario.problem()), scenario, info=info)


@pytest.fixture(scope="module")
def runs():
    map_1 = replace(Scenario.load("four_circles_1"), slip=0.0)
    moving = (kl.Circle(1.6, 0.2, 0.2, -0.15, 0.05), kl.Circle(-0.2, 1.4, 0.15, 0.12, -0.08))
    found = {
        "reached": a_run(map_1),
        "moving": a_run(replace(map_1, circles=moving)),
        "empty": a_run(replace(map_1, circles=())),
        "single": a_run(replace(map_1, timeout=0.1)),
        "timeout": a_run(replace(map_1, timeout=1.5)),
        "blind": a_run(map_1, Blind(kl.Controller(MODEL, map_1.problem()))),
        "collision": a_run(replace(map_1, circles=(kl.Circle(0.59, 0.0, 0.15),)), Straight()),
        "corridor": a_run(
            replace(
                map_1,
                bounds=(-1.0, -0.6, 9.0, 0.6),
                goal=(8.0, 0.0, 0.0),
                circles=(kl.Circle(3.0, 0.1, 0.2),),
                timeout=30.0,
            )
        ),
    }
    outcomes = {name: run.outcome for name, run in found.items()}
    late = dict.fromkeys(("single", "timeout"), Outcome.TIMEOUT)
    assert outcomes == {
        **dict.fromkeys(found, Outcome.REACHED),
        **late,
        "collision": Outcome.COLLISION,
    }
    assert {"SOLVED", "FALLBACK", "STOPPED"} <= set(found["blind"].statuses)
    return found


@pytest.fixture
def blank(monkeypatch):
    """Nothing is drawn on the pictures of a report: where only its words are looked at."""
    svg = b'<svg xmlns="http://www.w3.org/2000/svg"/>'
    monkeypatch.setattr("kmpc_lite.report.html.render", lambda figure, kind: svg)


class Page(HTMLParser):
    """Reads a page as a browser would.

    Text, tags with attributes, and whether every tag is closed.
    """

    VOID = frozenset({"meta", "img", "br", "link", "hr", "input"})

    def __init__(self, path):
        super().__init__()
        self.source = path.read_text(encoding="utf-8")
        self.tags, self.text, self.open, self.scripts = [], [], [], []
        self.feed(self.source)
        self.close()
        assert self.open == []
        self.words = " ".join(" ".join(self.text).replace("\xa0", " ").split())

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "script":
            self.scripts.append(data)
        else:
            self.text.append(data)

    def only_our_script(self):
        """Whether the page has its data and our script, which the browser knows by its hash."""
        code, known = script()
        elements = [a for tag, a in self.tags if tag == "script"]
        policy = next(a["content"] for tag, a in self.tags if "http-equiv" in a)
        return (
            self.source.count("<script") == self.source.count("</script") == 2
            and elements == [{"id": "drive", "type": "application/json"}, {}]
            and self.scripts[1] == code
            and isinstance(json.loads(self.scripts[0]), dict)
            and policy.startswith("default-src 'none'; ")
            and f"script-src '{known}'" in policy
        )

    def svgs(self):
        return [
            b64decode(a["src"].removeprefix("data:image/svg+xml;base64,"), validate=True)
            for tag, a in self.tags
            if tag == "img"
        ]


def some(quick, more):
    """Names of runs, of which some are for `make test-long`."""
    return [*quick, *(pytest.param(name, marks=pytest.mark.long) for name in more)]


@pytest.mark.parametrize("name", some(["blind", "empty"], ["timeout", "collision"]))
def test_the_report_is_one_file_that_tells_the_numbers(runs, name, tmp_path):
    run = runs[name]
    write_report(tmp_path / "run.html", run, MODEL, FIT, command="kmpc simulate --seed 3", **LIMITS)
    page = Page(tmp_path / "run.html")
    for tag, attributes in page.tags:
        assert tag not in ("link", "iframe", "object", "base")
        assert not any(key.startswith("on") for key in attributes)
        assert attributes.get("src", "data:").startswith("data:") and "href" not in attributes
    # a name within the page is no address
    assert not re.search(r"url\((?!#)", page.source) and "@import" not in page.source
    assert page.only_our_script() and len(page.source) < 2_000_000
    assert len(page.svgs()) == 5
    for svg in page.svgs():
        for element in ElementTree.fromstring(svg).iter():
            for key, value in element.attrib.items():
                if key.endswith("href"):
                    assert value.startswith(("#", "data:"))
                assert not re.search(r"url\((?!#)", value)
    assert f"{run.duration:.4g} s" in page.words and f"{run.heading_error:.3f} rad" in page.words
    error = run.position_error
    assert (f"{error:.2f} m" if error >= 1 else f"{1e3 * error:.0f} mm") in page.words
    for share in (0.5, 0.99, 1.0):
        value = 1e3 * float(np.quantile(run.step_times, share))
        said = [float(v) for v in re.findall(r"([\d.]+) ms", page.words)]
        assert min(abs(v - value) for v in said) <= 0.01 * value
    for status in set(run.statuses):
        assert f"{status} {run.statuses.count(status)} of {len(run.statuses)} steps" in page.words
    assert ("no obstacles" in page.words) == (name == "empty")
    assert "kmpc simulate --seed 3" in page.words
    assert (
        "5.55 %" in page.words
        and "1234 starts" in page.words
        and "nominal unicycle 21 22 23" in page.words
    )
    assert (
        f"osqp {sys.modules['osqp'].__version__}" in page.words
        and f"numpy {np.__version__}" in page.words
    )
    toml = next(text for text in page.text if text.startswith("[map]"))
    again = Scenario.from_table(tomllib.loads(toml), run.scenario.name, "page")
    assert all(getattr(again, f.name) == getattr(run.scenario, f.name) for f in fields(Scenario))


def test_the_page_tells_what_the_robot_was_put_through(runs, tmp_path, blank):
    from kmpc_lite.sim.scenario.values import Floor

    changed = {
        "slip": 0.07,
        "lag": 0.3,
        "dead_time": 0.15,
        "pose_age": 0.125,
        "pose_noise": (0.005, 0.006, 0.02),
        "floors": (Floor(5.0, 0.2, 0.6), Floor(8.0, 0.01)),
        "du_max": (1.0, 4.0),
        "turning_point": (0.04, -0.02),
    }
    run = replace(runs["single"], scenario=replace(runs["single"].scenario, **changed))
    words = {}
    for plant in ("slip", "learned", "a rover <of mine>"):
        write_report(tmp_path / "run.html", replace(run, info={"plant": plant}))
        page = Page(tmp_path / "run.html").words
        words[plant] = page[
            page.index("The robot and its conditions") : page.index("The scenario Name")
        ]
    acting = (
        "Mean slip 7 %",
        "Lag of the motors 300 ms (time constant)",
        "Dead time before them 150 ms",
        "Floor from 5 s on mean slip 20 %, 60 % of a turn happens",
        "Floor from 8 s on mean slip 1 %, 100 % of a turn happens",
        "Turns about a point 40 mm ahead of its centre, -20 mm to the left",
    )
    seen = ("Noise of the measured pose 5 mm, 6 mm, 0.02 rad", "Age of the measured pose 125 ms")
    for line in (*acting, *seen):
        assert line in words["slip"]
        assert (line in words["learned"]) == (line in seen)
        assert line not in words["a rover <of mine>"]
    assert all("Commands change by at most 1 m/s², 4 rad/s²" in text for text in words.values())
    assert (
        "behaves as the model does" in words["learned"]
        and "a rover <of mine>" in words["a rover <of mine>"]
    )
    write_report(tmp_path / "run.html", runs["single"])
    plain = Page(tmp_path / "run.html").words
    for name in (
        "Lag of the motors",
        "Dead time before them",
        "Changes of the floor",
        "Age of the measured pose",
    ):
        assert f"{name} none" in plain


def test_the_page_tells_the_options_that_were_changed(runs, tmp_path, blank):
    tuned = {"guidance": {"lead_time": 0.35}, "solver": {"real_time": {"max_iter": 80}}}
    options = kl.ControllerOptions.from_dict(tuned)
    scenario = replace(runs["single"].scenario, options=options)
    controller = kl.Controller(MODEL, scenario.problem(), options=options)
    driven = a_run(scenario, controller)
    assert driven.info["options"] == tuned
    driven.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    assert again.scenario.options == options and again.info["options"] == tuned
    write_report(tmp_path / "run.html", again)
    words = Page(tmp_path / "run.html").words
    assert "Option guidance.lead_time 0.35, usually 0.2" in words
    assert "Option solver.real_time.max_iter 80, usually 60" in words
    assert words.count("Option ") == 2
    write_report(tmp_path / "run.html", runs["single"])
    assert "Option " not in Page(tmp_path / "run.html").words


def test_what_users_name_is_shown_and_never_run(runs, tmp_path, blank):
    run = replace(
        runs["single"],
        scenario=replace(runs["single"].scenario, name=HOSTILE),
        info={HOSTILE: [HOSTILE]},
    )
    model = replace(MODEL, info={"method": HOSTILE, "log": [HOSTILE], "condition": 7.5})
    write_report(tmp_path / "run.html", run, model, title=HOSTILE, command=HOSTILE)
    page = Page(tmp_path / "run.html")
    assert page.only_our_script()
    # title, heading, scenario in two places, method, log, command; the lone surrogate stands for a
    # byte that is not UTF-8
    visible = HOSTILE.rstrip("\udce9")
    assert page.words.count(visible.strip()) >= 7


def test_the_same_input_gives_the_same_bytes(runs, tmp_path):
    before = dict(matplotlib.rcParams)
    write_report(tmp_path / "a.html", runs["single"], MODEL, FIT, **LIMITS)
    picture = render(map_picture(runs["moving"]), "png")
    assert dict(matplotlib.rcParams) == before
    with matplotlib.rc_context(
        {"font.size": 30, "axes.facecolor": "black", "svg.hashsalt": None, "text.usetex": True}
    ):
        write_report(tmp_path / "b.html", runs["single"], MODEL, FIT, **LIMITS)
        again = render(map_picture(runs["moving"]), "png")
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    assert picture == again
    assert b"<dc:date>" not in b"".join(Page(tmp_path / "a.html").svgs())


@pytest.mark.parametrize(
    "name",
    some(["reached", "corridor", "blind"], ["moving", "empty", "single", "timeout", "collision"]),
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


def test_a_saved_run_gives_the_same_pictures(runs, tmp_path):
    run = runs["collision"]
    run.save(tmp_path / "run.npz")
    again = Run.load(tmp_path / "run.npz")
    for draw in (map_picture, errors_picture):
        assert render(draw(again), "svg") == render(draw(run), "svg")


def test_without_matplotlib_one_line_says_what_to_install(runs, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for make in (
        lambda: write_report(tmp_path / "run.html", runs["single"]),
        lambda: write_pictures(tmp_path / "p", runs["single"]),
    ):
        with pytest.raises(kl.KmpcError, match=r"pip install 'kmpc-lite\[plot\]'"):
            make()
    assert list(tmp_path.iterdir()) == []


def test_importing_the_report_does_not_import_matplotlib():
    code = "import sys, kmpc_lite.report; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_what_cannot_be_written_or_drawn_is_said(runs, tmp_path, blank):
    with pytest.raises(kl.KmpcError, match=r"missing.run\.html: cannot write"):
        write_report(tmp_path / "missing" / "run.html", runs["single"])
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(kl.KmpcError, match="taken: cannot make the folder"):
        write_pictures(tmp_path / "taken", runs["single"])
    (tmp_path / "folder").mkdir()
    with pytest.raises(kl.KmpcError, match="folder: cannot write"):
        write_picture(tmp_path / "folder", b"page")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder", "taken"]
    away = runs["single"].path.copy()
    away[-1] = np.inf
    with pytest.raises(kl.KmpcError, match="NaN or infinity"):
        write_report(tmp_path / "run.html", replace(runs["single"], path=away))
    with pytest.raises(kl.KmpcError, match="at least one step"):
        map_picture(replace(runs["single"], inputs=np.empty((0, 2))))


def test_how_a_drive_ended_is_said_and_never_run(runs, tmp_path, blank):
    late = next(run for run in runs.values() if run.outcome is Outcome.TIMEOUT)
    write_report(tmp_path / "run.html", replace(late, info={"ended": f"SIGINT; {HOSTILE}"}))
    page = Page(tmp_path / "run.html")
    assert "How it ended: SIGINT; <script>alert(1)</script>" in page.words
    assert page.only_our_script()
