"""The page of a run: what it says, and what it must never do."""

import json
import re
import sys
import tomllib
import xml.etree.ElementTree as ElementTree
from dataclasses import fields, replace

import matplotlib
import numpy as np
import pytest
from report_page import HOSTILE, LIMITS, MODEL, TOLD, Page, a_run, some

import kmpc_lite as kl
from kmpc_lab import draw_drives, write_report
from kmpc_lite.scenario.files import Scenario


@pytest.mark.parametrize("name", some(["blind"], ["empty", "timeout", "collision"]))
def test_the_report_is_one_file_that_shows_the_numbers(runs, name, tmp_path):
    run = runs[name]
    write_report(tmp_path / "run.html", run, TOLD, command="kmpc simulate --seed 3", **LIMITS)
    page = Page(tmp_path / "run.html")
    for tag, attributes in page.tags:
        assert tag not in ("link", "iframe", "object", "base")
        assert not any(key.startswith("on") for key in attributes)
        assert attributes.get("src", "data:").startswith("data:") and "href" not in attributes
    # a name within the page is no address
    assert not re.search(r"url\((?!#)", page.source) and "@import" not in page.source
    assert page.only_our_script() and len(page.source) < 2_000_000
    assert len(page.svgs()) == 1
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


def test_the_page_shows_the_options_that_were_changed(runs, tmp_path, blank):
    tuned = {"guidance": {"lead_time": 0.35}, "solver": {"real_time": {"max_iter": 80}}}
    options = kl.ControllerOptions.from_dict(tuned)
    scenario = replace(runs["single"].scenario, options=options)
    controller = kl.Controller(MODEL, scenario.problem(), options=options)
    driven = a_run(scenario, controller)
    assert driven.info["options"] == tuned
    write_report(tmp_path / "run.html", driven)
    words = Page(tmp_path / "run.html").words
    assert f"Options that were changed {json.dumps(tuned)}" in words
    write_report(tmp_path / "run.html", runs["single"])
    assert "Options that were" not in Page(tmp_path / "run.html").words


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
    # title, heading, scenario, method, log, command; the lone surrogate stands for a
    # byte that is not UTF-8
    visible = HOSTILE.rstrip("\udce9")
    assert page.words.count(visible.strip()) >= 6


def test_the_same_input_gives_the_same_bytes(runs, tmp_path):
    before = dict(matplotlib.rcParams)
    write_report(tmp_path / "a.html", runs["single"], TOLD, **LIMITS)
    draw_drives(tmp_path / "a.png", {"a": runs["moving"]})
    assert dict(matplotlib.rcParams) == before
    with matplotlib.rc_context(
        {"font.size": 30, "axes.facecolor": "black", "svg.hashsalt": None, "text.usetex": True}
    ):
        write_report(tmp_path / "b.html", runs["single"], TOLD, **LIMITS)
        draw_drives(tmp_path / "b.png", {"a": runs["moving"]})
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert b"<dc:date>" not in b"".join(Page(tmp_path / "a.html").svgs())


def test_without_matplotlib_one_line_says_what_to_install(runs, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    for make in (
        lambda: write_report(tmp_path / "run.html", runs["single"]),
        lambda: draw_drives(tmp_path / "p.png", {"a": runs["single"]}),
    ):
        with pytest.raises(kl.KmpcError, match=r"pip install 'kmpc-lab\[plot\]'"):
            make()
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_written_or_drawn_is_said(runs, tmp_path, blank):
    with pytest.raises(kl.KmpcError, match=r"missing.run\.html: cannot write"):
        write_report(tmp_path / "missing" / "run.html", runs["single"])
    (tmp_path / "folder").mkdir()
    with pytest.raises(kl.KmpcError, match="folder: cannot write"):
        draw_drives(tmp_path / "folder", {"a": runs["single"]})
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]
    away = runs["single"].path.copy()
    away[-1] = np.inf
    with pytest.raises(kl.KmpcError, match="NaN or infinity"):
        write_report(tmp_path / "run.html", replace(runs["single"], path=away))
    with pytest.raises(kl.KmpcError, match="at least one step"):
        write_report(tmp_path / "run.html", replace(runs["single"], inputs=np.empty((0, 2))))
