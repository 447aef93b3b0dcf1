"""The page plays a drive: on a desk and on a phone, with keys, and for screen readers."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="needs the extra plot")
from browser import Browser, Page, needs_browser

import kmpc_lite as kl
from firmware_bridge.recording.drive.encoder import DriveEncoder
from firmware_bridge.recording.drive.schemas import Ended, Gate, PoseSeen, Sent, Stepped
from kmpc_lab import Run, write_report
from kmpc_lab.recording.drive_file import load_drive
from kmpc_lab.report.moments import APART, events_of
from kmpc_lab.report.player import BUDGET, player_data
from kmpc_lite.scenario.files import Scenario

HOSTILE = "</script><script>window.bad = 1</script><img src=x onerror='window.bad = 1'>"
SCENARIO = """\
[map]
bounds = [-1.0, -1.0, 2.0, 1.5]
circles = [[0.7, 0.5, 0.15], [1.0, -0.8, 0.1, 0.0, 0.2]]
polygons = [[[1.5, 0.8], [1.9, 0.8], [1.6, 1.2]]]
walls = [[-0.8, -0.8, -0.3, -0.8, 0.1]]
grid = {resolution = 0.1, origin = [-0.8, 0.8, 0.3], rows = ["..#", "?.#"]}
[robot]
start = [0.0, 0.0, 0.0]
goal = [1.2, 0.1, 0.0]
"""
STEPS = 24
HOLES = (
    "[...document.querySelectorAll('#map mask path')]"
    ".filter((p) => /^M[-0-9., ]+Z/.test(p.getAttribute('d'))).length"
)
"""Masks of the map through which something is seen."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A drive on a real link, as it was recorded: a scan, a gate that stops, and hostile words."""
    folder = tmp_path_factory.mktemp("drive")
    (folder / "field.toml").write_text(SCENARIO)
    scenario = replace(Scenario.load(folder / "field.toml"), name=HOSTILE)
    controller = kl.Controller(kl.nominal_unicycle(0.1), scenario.problem())
    encoder = DriveEncoder(scenario, 0.1, {"kind": "driven", "command": HOSTILE}, 1.7e9)
    pose, records = np.zeros(3), list[Any]()
    for k in range(STEPS):
        time, place = 5.0 + 0.1 * k, (float(pose[0]), float(pose[1]), float(pose[2]))
        circles = scenario.circles_at(0.1 * k)
        plan = controller.step(pose, scenario.goal, scenario.obstacles_at(0.1 * k))
        if k == 12:
            plan = replace(plan, status=kl.PlanStatus.FALLBACK, reason=HOSTILE)
        scan = kl.LaserScan([1.0, np.inf, 0.8], angle_min=0.0, angle_increment=0.5, range_max=4.0)
        path = np.array([[0.0, 0.0, 0.0], [0.5, 0.1 + (k > 10), 0.0], [1.2, 0.1, 0.0]])
        margins = np.linspace(0.05, 0.1, 20)
        records += [
            PoseSeen(time - 0.02, place),
            Stepped(time, place, plan, path, margins, circles, 0.02, scan),
            Sent(time + 0.01, (*plan.command.tolist(), 0.0)),
        ]
        pose = plan.states[1]
    records += [Gate(5.0, "ACTIVE"), Gate(6.5, "STOPPING", ("board not heard",))]
    ended = Ended(8.0, {"outcome": "timeout", "duration": 2.4, "clearance": 0.3, "words": HOSTILE})
    file = folder / "drive.mcap"
    file.write_bytes(b"".join([encoder.begin(5.0), *encoder.encode([*records, ended])]))
    return load_drive(file)


@pytest.fixture(scope="module")
def file(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    write_report(path, run, title=HOSTILE, command=HOSTILE)
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with Browser() as started:
        yield started


def opened(browser: Browser, file: Path, at: str = "", **how: Any) -> Page:
    page = browser.page(**how)
    page.open(file.as_uri() + at)
    return page


@needs_browser
@pytest.mark.parametrize("how", [{}, {"width": 390, "height": 844, "touch": True}])
def test_it_fits_asks_for_nothing_and_runs_nothing_of_the_drive(
    browser: Browser, file: Path, how: dict[str, Any]
) -> None:
    page = opened(browser, file, **how)
    assert page.errors == [] and page.requests == [file.as_uri()]
    assert page.run("window.bad") is None and page.text("h1") == HOSTILE
    assert page.run("document.documentElement.scrollWidth <= innerWidth")
    first = "document.querySelector('main > header + *') === document.querySelector('.player')"
    assert page.run(first) and page.run("document.querySelector('.player h2 + * svg').id") == "map"
    small = page.run(
        "[...document.querySelectorAll('.controls button, .controls select, #time')]"
        ".map((e) => e.getBoundingClientRect()).filter((b) => b.height < 39 || b.width < 39).length"
    )
    assert small == 0, "fingers need room"


@needs_browser
def test_the_map_shows_what_was_there(browser: Browser, file: Path, run: Run) -> None:
    page = opened(browser, file)
    shown = "[...document.querySelectorAll('#map .{}')].length"
    assert page.run(shown.format("shade")) == 2 and page.run(HOLES) == 2
    assert page.run(shown.format("scan")) >= 2 and page.run(shown.format("plan")) == 1
    assert page.run(shown.format("room")) == 10 and page.run(shown.format("ring")) >= 1
    assert page.run(shown.format("path")) == 1 and page.run(shown.format("edge")) == 1
    before = page.run("document.querySelector('#map .solid[cx]').parentNode.innerHTML")
    page.press("End")
    assert before != page.run("document.querySelector('#map .solid[cx]').parentNode.innerHTML")
    ends = page.run(
        "(() => { const numbers = (text) => text.match(/[-\\d.]+/g).map(Number); "
        "const robot = document.querySelector('#map .robot').parentNode.getAttribute('transform'); "
        "const driven = document.querySelector('#map .driven').getAttribute('points'); "
        "return [numbers(robot).slice(0, 2), numbers(driven).slice(-2)]; })()"
    )
    assert ends[0] == pytest.approx(ends[1], abs=0.1), "the robot stands where its path ends"
    page.run("document.querySelectorAll('.layers input')[1].click()")
    assert (
        page.run("getComputedStyle(document.querySelector('#map .plan').parentNode).display")
        == "none"
    )


@needs_browser
def test_screen_readers_are_reported_what_is_what(browser: Browser, file: Path) -> None:
    page = opened(browser, file)
    known = page.tree()
    assert ("slider", "Time of the drive") in known and ("button", "Play") in known
    assert ("button", "One step back") in known and ("heading", "The drive, step by step") in known
    assert any(role == "combobox" and "Speed" in name for role, name in known)
    images = [name for role, name in known if role in ("img", "image")]
    assert any(name.startswith("Map of the drive") for name in images)
    assert any("Forward speed over time, planned from" in name for name in images)
    assert page.run("document.querySelector('#said').getAttribute('aria-live')") == "polite"
    page.press("ArrowRight")
    value = page.run("document.querySelector('#time').getAttribute('aria-valuetext')")
    assert value == "0.1 s: solved"


def test_the_numbers_are_those_of_the_run(run: Run) -> None:
    data = json.loads(player_data(run, None, None, {}))
    details = run.details
    assert details is not None
    for name, kind, values in (
        ("time", "<f4", details.times),
        ("margin", "<f4", details.margins[:, [0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20]]),
    ):
        found = np.frombuffer(_bytes(data[name]), kind)
        np.testing.assert_allclose(found, values.ravel(), atol=1e-5)
    plan = np.frombuffer(_bytes(data["plan"]), "<i2").reshape(STEPS, -1, 2) * data["plan"]["step"]
    np.testing.assert_allclose(
        plan[:, -1] + data["plan"]["middle"], details.plans[:, -1, :2], atol=0.001
    )
    assert data["gates"] == ["active", "stopping: board not heard"] and data["every"] == 1
    assert {chart["title"] for chart in data["series"]} >= {"Clearance", "Age of the pose"}


def _bytes(part: dict[str, Any]) -> bytes:
    from base64 import b64decode

    return b64decode(part["data"])


def test_a_day_fits_into_a_page(run: Run) -> None:
    details = run.details
    assert details is not None
    many = 20_000
    long = replace(
        details,
        **{
            name: np.resize(getattr(details, name), (many, *getattr(details, name).shape[1:]))
            for name in (
                *("poses", "plans", "margins", "commands", "clearances", "pose_ages"),
                *("step_times", "path_of", "circles_of"),
            )
        },
        times=0.1 * np.arange(many),
        statuses=details.statuses * many,
        progress=details.progress * many,
        reasons=details.reasons * many,
        scans=tuple((0.1 * k, kl.LaserScan(np.ones(360), 0.0, 0.01, 4.0)) for k in range(many)),
    )
    text = player_data(replace(run, details=long), None, None, {})
    assert len(text) < BUDGET and json.loads(text)["every"] > 10


def test_what_happened_is_reported_once(run: Run) -> None:
    assert run.details is not None
    expected = [
        "sets out on its path",
        "takes another path",
        f"rest of the last good plan: {HOSTILE}",
        "safety gate stopping: board not heard",
    ]
    words = [event.words for event in events_of(run.details)]
    assert [word for word in words if word in expected] == expected
    statuses = ("SOLVED", "FEASIBLE") * (STEPS // 2)
    flutter = replace(run.details, statuses=statuses, reasons=("",) * STEPS)
    said = [event for event in events_of(flutter) if "stopped early" in event.words]
    assert len(said) == 1 and said[0].bad and APART > 0.2
