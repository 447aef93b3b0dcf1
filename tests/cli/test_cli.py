"""kmpc from the outside: what it prints, what it writes, and one line with status 2 for whatever is
wrong.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.cli import main as cli
from kmpc_lite.cli.command import build_parser, known_commands
from kmpc_lite.cli.progress import Progress
from kmpc_lite.sim import Run, Scenario
from kmpc_lite.studies import contenders
from kmpc_lite.studies import table1 as study

COMMANDS = ("demo", "fit", "simulate", "report", "study", "bench")
NEEDS_PICTURES = pytest.mark.skipif(
    importlib.util.find_spec("matplotlib") is None, reason="needs the extra plot"
)
SHORT = """\
[map]
bounds = [-2.0, -2.0, 2.0, 2.0]
circles = [[0.5, 0.6, 0.15]]
[robot]
start = [0.0, 0.0, 0.0]
goal = [0.7, 0.0, 0.0]
[run]
timeout = 4.0
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a log, a model, a run and a scenario; not to be written to."""
    folder = tmp_path_factory.mktemp("made")
    plant = kl.DifferentialDrive(0.05, seed=1)
    data = kl.generate_dataset(plant, episodes=16, steps=60, dt=0.1, seed=1, u_max=(0.6, 0.8))
    data.save(folder / "drive.csv")
    kl.Dataset(data.windows(4.0).episodes[:1]).save(folder / "brief.csv")
    kl.fit(data).save(folder / "robot.npz")
    (folder / "short.toml").write_text(SHORT)
    assert (
        cli.main(
            ["simulate", "--scenario", str(folder / "short.toml"), "-o", str(folder / "run.npz")]
        )
        == 0
    )
    return folder


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder."""
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    return folder


def files(folder: Path) -> list[str]:
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*"))


def test_fit_writes_a_model_and_tells_how_good_it_is(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["fit", str(made / "drive.csv"), "-o", "robot.npz", "--horizon", "1.5"]) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "nominal unicycle" in out and "1.5 s" in out and "robot.npz" in out
    model = kl.KoopmanModel.load("robot.npz")
    assert model.dt == 0.1
    assert model.info["held_out"]["horizon"] == pytest.approx(1.5)
    assert model.info["log"] == [str(made / "drive.csv")]
    assert files(here) == ["robot.npz"]


def test_fit_tells_how_much_room_the_margins_take(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, random = kl.Dataset.load(made / "drive.csv"), np.random.default_rng(0)
    noisy = [
        kl.Episode(
            e.states + random.normal(size=e.states.shape) * (0.02, 0.02, 0.02), e.inputs, e.dt
        )
        for e in data.episodes
    ]
    kl.Dataset(noisy).save("noisy.csv")
    rooms = []
    for log in (made / "drive.csv", here / "noisy.csv"):
        assert cli.main(["fit", str(log), "-o", "robot.npz"]) == 0
        told = re.search(
            r"^margins: calibrated on \d+ held-out windows; "
            r"(\d+) cm from what it passes, \d+ cm from what lies ahead at 0\.\d+ m/s$",
            capsys.readouterr().out,
            re.M,
        )
        assert told is not None
        rooms.append(int(told[1]))
    # three standard deviations of a pose that errs by 2 cm
    assert 1 <= rooms[0] <= 5 < rooms[1]


def test_fit_takes_every_dictionary_and_method(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = str(made / "drive.csv")
    for options, history, continuous in (
        (["--dictionary", "unicycle", "--method", "edmdc"], 0, False),
        (["--dictionary", "hermite1"], 0, True),
        (["--lags", "0", "1", "2", "--product"], 2, True),
    ):
        assert cli.main(["fit", log, "-o", "robot.npz", "--json", *options]) == 0
        told = json.loads(capsys.readouterr().out)
        model = kl.KoopmanModel.load("robot.npz")
        assert (model.history, model.continuous) == (history, continuous)
        assert told["model"] == "robot.npz"
        assert told["samples"] == model.info["samples"] > 0
        assert told["margins"].startswith(("calibrated on", "not calibrated"))
        assert all(
            np.isfinite(told["held_out"][key]).all()
            for key in ("one_step", "multi_step", "nominal_one_step")
        )


def test_fit_takes_several_logs_and_another_period(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        cli.main(
            [
                "fit",
                str(made / "drive.csv"),
                str(made / "brief.csv"),
                "-o",
                "robot.npz",
                "--dt",
                "0.2",
            ]
        )
        == 0
    )
    assert kl.KoopmanModel.load("robot.npz").dt == 0.2
    assert "0.2 s" in (told := capsys.readouterr().out)
    counts = [int(n) for n in re.findall(r"Dataset\((\d+) episodes", told)]
    assert sum(counts) == 17  # those of both


def test_fit_is_the_same_for_the_same_seed(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told = []
    for seed in ("1", "1", "2"):
        assert (
            cli.main(["fit", str(made / "drive.csv"), "-o", "robot.npz", "--json", "--seed", seed])
            == 0
        )
        told.append(json.loads(capsys.readouterr().out)["held_out"])
    assert told[0] == told[1] != told[2]


def test_simulate_drives_and_keeps_the_run(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = str(made / "short.toml")
    assert (
        cli.main(
            [
                "simulate",
                "--model",
                str(made / "robot.npz"),
                "--scenario",
                scenario,
                "--seed",
                "5",
                "--margin",
                "0.03",
                "-o",
                "run.npz",
            ]
        )
        == 0
    )
    out, err = capsys.readouterr()
    assert out.startswith("reached after") and "run.npz" in out and err == ""
    run = Run.load("run.npz")
    assert run.outcome.value == "reached"
    assert (run.scenario.name, run.scenario.seed, run.scenario.margin) == ("short", 5, 0.03)
    assert files(here) == ["run.npz"]


def test_simulate_tells_machines_the_same(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        cli.main(["simulate", "--scenario", str(made / "short.toml"), "--json", "-o", "run.npz"])
        == 0
    )
    told = json.loads(capsys.readouterr().out)
    assert told == Run.load("run.npz").summary()
    assert told["outcome"] == "reached" and told["position_error_m"] < 0.05


def test_simulate_drives_with_the_options_of_the_scenario(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "tuned.toml").write_text(f"{SHORT}[controller.guidance]\nlead_time = 0.3\n")
    assert cli.main(["simulate", "tuned.toml", "--json", "-o", "run.npz"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["options"] == {"guidance": {"lead_time": 0.3}}
    (here / "wrong.toml").write_text(f"{SHORT}[controller.guidance]\nlead_tim = 0.3\n")
    assert cli.main(["simulate", "wrong.toml"]) == 2
    assert "did you mean 'lead_time'?" in capsys.readouterr().err


def test_simulate_on_a_plant_like_the_model(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [
        "simulate",
        "--model",
        str(made / "robot.npz"),
        "--scenario",
        str(made / "short.toml"),
        "--plant",
        "learned",
        "--json",
    ]
    assert cli.main(arguments) == 0
    assert json.loads(capsys.readouterr().out)["plant"] == "learned"


def test_a_drive_that_does_not_arrive_has_status_one(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "late.toml").write_text(SHORT.replace("timeout = 4.0", "timeout = 0.5"))
    assert cli.main(["simulate", "--scenario", "late.toml"]) == 1
    assert capsys.readouterr().out.startswith("timeout after 0.50 s")


@NEEDS_PICTURES
def test_a_drive_that_fails_for_its_lag_says_so(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    late = SHORT.replace("timeout = 4.0", "timeout = 0.2")
    (here / "prompt.toml").write_text(late)
    (here / "late.toml").write_text(late + "[plant]\nlag = 0.3\n")
    history = kl.InputHistoryDictionary(kl.HermiteTrigDictionary(0), lags=(0, 1, 2))
    kl.fit(kl.Dataset.load(made / "drive.csv"), history).save(here / "history.npz")
    words = {
        (
            "prompt.toml",
            "history.npz",
            "slip",
        ): "looks back on 2 past commands, this robot obeys at once: --plant learned",
        (
            "late.toml",
            "robot.npz",
            "slip",
        ): "obeys late, its model knows no lag: learn it from a log of the robot with kmpc fit",
        ("late.toml", "history.npz", "slip"): "",
        ("prompt.toml", "history.npz", "learned"): "",
        ("prompt.toml", "robot.npz", "slip"): "",
    }
    for (scenario, model, plant), hint in words.items():
        file = here / model if model == "history.npz" else made / model
        assert (
            cli.main(["simulate", "--scenario", scenario, "--model", str(file), "--plant", plant])
            == 1
        )
        told = capsys.readouterr().out
        assert (
            told.startswith("timeout after 0.20 s")
            and ("hint" in told) == bool(hint)
            and hint in told
        )


def test_report_of_a_run_and_of_its_model(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        cli.main(
            [
                "report",
                str(made / "run.npz"),
                "-o",
                "run.html",
                "--model",
                str(made / "robot.npz"),
                "--json",
            ]
        )
        == 0
    )
    assert json.loads(capsys.readouterr().out) == {"written": ["run.html"]}
    page = (here / "run.html").read_text()
    assert page.lstrip().lower().startswith("<!doctype html>")
    # self-contained: nothing is fetched
    assert not re.search(r"""(?:src|href)\s*=\s*["']?(?:https?:)?//""", page)


@pytest.fixture
def blank(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is drawn on the pictures of a report: where only its words are looked at."""
    monkeypatch.setattr("kmpc_lite.report.html.render", lambda figure, kind: b"<svg/>")


@NEEDS_PICTURES
def test_a_report_made_later_tells_how_the_run_was_driven(
    made: Path, here: Path, monkeypatch: pytest.MonkeyPatch, blank: None
) -> None:
    drove = [
        "simulate",
        "--scenario",
        str(made / "short.toml"),
        "--seed",
        "5",
        "-o",
        "run.npz",
        "--report",
        "first.html",
    ]
    for words in (drove, ["report", "run.npz", "-o", "later.html"]):
        monkeypatch.setattr(sys, "argv", ["kmpc", *words])
        assert cli.main(words) == 0
    command = "<td>kmpc " + " ".join(drove) + "</td>"
    first, later = (here / "first.html").read_text(), (here / "later.html").read_text()
    assert f'<th scope="row">Command</th>{command}' in first and "Driven by" not in first
    assert (
        f'<th scope="row">Driven by</th>{command}' in later
        and "<td>kmpc report run.npz -o later.html</td>" in later
    )


@NEEDS_PICTURES
def test_report_as_pictures(made: Path, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["report", str(made / "run.npz"), "--pictures", "figures"]) == 0
    told = [line.split()[-1] for line in capsys.readouterr().out.splitlines()]
    assert told and sorted(told) == sorted(
        str(Path("figures") / p.name) for p in (here / "figures").iterdir()
    )
    for name in told:
        assert Path(name).read_bytes().startswith(b"\x89PNG")


@NEEDS_PICTURES
def test_demo_does_the_main_job(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["demo", "--robot", "simulated", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["outcome"] == "reached" and told["clearance_m"] > 0
    assert set(files(here)) == {
        "out",
        "out/drive.csv",
        "out/report.html",
        "out/robot.npz",
        "out/run",
        "out/run/drive.mcap",
        "out/run.npz",
    }
    assert told["held_out"]["multi_step"][0] < told["held_out"]["nominal_multi_step"][0]
    # what it wrote is what the other commands take
    assert len(kl.Dataset.load("out/drive.csv")) == 20
    assert Run.load("out/run.npz").scenario.name == "four_circles_1"
    assert cli.main(["report", "out/run", "-o", "again.html"]) == 0
    assert 'id="drive"' in Path("again.html").read_text(), "it plays"
    assert kl.KoopmanModel.load("out/robot.npz").info["log"] == ["out/drive.csv"]


def test_demo_with_a_log_of_ones_own(
    made: Path, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pages: list[Path] = []
    monkeypatch.setattr(
        "kmpc_lite.report.write_report", lambda page, run, **more: pages.append(page)
    )
    assert cli.main(["demo", "--log", str(made / "drive.csv"), "-o", "mine"]) == 0
    out = capsys.readouterr().out
    assert str(made / "drive.csv") in out and "reached" in out and str(pages[0]) in out
    written = ["mine", "mine/robot.npz", "mine/run", "mine/run.npz", "mine/run/drive.mcap"]
    assert sorted(files(here)) == sorted(written)
    assert Run.load("mine/run.npz").info["plant"] == "learned"


def small_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """Table 1 with two controllers at one slip, little training and a short drive."""
    rows = (
        contenders.Contender("exact", fit=None),
        contenders.Contender("learned"),
    )
    table = partial(
        study.table1, controllers=rows, lambdas=(0.0,), training={"episodes": 6, "steps": 30}
    )
    monkeypatch.setattr(study, "table1", table)
    monkeypatch.setattr(contenders, "TABLE_1_CONTENDERS", rows)


def test_study_prints_the_table(
    made: Path, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    small_table(monkeypatch)
    arguments = [
        "study",
        "table1",
        "--trials",
        "1",
        "--workers",
        "1",
        "--scenario",
        str(made / "short.toml"),
        "--records",
        "table.jsonl",
    ]
    assert cli.main(arguments) == 0
    out, err = capsys.readouterr()
    assert "paper: K-NMPC" in out and "exact" in out and "learned, trained at 0.1" in out
    assert err == ""  # no progress bar where there is no terminal
    assert cli.main([*arguments, "--json", "--resume"]) == 0  # nothing is driven again
    cells = json.loads(capsys.readouterr().out)
    assert [(c["controller"], c["slip"], c["trials"]) for c in cells] == [
        ("exact", 0.0, 1),
        ("learned", 0.0, 1),
        ("learned", 0.15, 1),
        ("learned", 0.2, 1),
    ]


def test_study_tells_at_once_that_peers_are_missing(
    made: Path, here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)
    monkeypatch.setattr(study, "train", lambda *_: pytest.fail("trained before it looked"))
    assert cli.main(["study", "table1", "--workers", "1"]) == 2
    assert "pip install 'kmpc-lite[peers]'" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help_shows_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main([*name.split(), "--help"])
    assert ended.value.code == 0
    out = capsys.readouterr().out
    if name:
        assert f"example:\n  kmpc {name}" in out and "--json" in out
    else:
        assert all(command in out for command in COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_the_examples_of_the_help_can_be_parsed(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        cli.main([name, "--help"])
    lines = re.findall(
        r"^  kmpc (.*)$", capsys.readouterr().out.partition("example:")[2], re.MULTILINE
    )
    assert lines
    for line in lines:
        words = re.split(r"\s+[#>]\s", line)[0].split()
        assert build_parser(known_commands(), words).parse_args(words).run


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out.strip() == f"kmpc_lite {kl.__version__}"


BAD_LINES = [
    "",
    "fly",
    "fit",
    "fit {made}/drive.csv",
    "fit {made}/none.csv -o robot.npz",
    "fit {made} -o robot.npz",
    "fit {made}/drive.txt -o robot.npz",
    "fit {made}/robot.npz -o other.npz",
    "fit {made}/short.toml -o robot.npz",
    "fit {made}/brief.csv -o robot.npz",
    "fit {made}/drive.csv {made}/brief.csv {made}/drive.csv -o robot.npz",
    "fit {made}/drive.csv -o no/folder/robot.npz",
    "fit {made}/drive.csv -o .",
    "fit {made}/drive.csv -o {made}/drive.csv",
    "fit {made}/drive.csv -o robot.npz --seed -1",
    "fit {made}/drive.csv -o robot.npz --seed one",
    "fit {made}/drive.csv -o robot.npz --holdout 0",
    "fit {made}/drive.csv -o robot.npz --holdout 1.5",
    "fit {made}/drive.csv -o robot.npz --holdout nan",
    "fit {made}/drive.csv -o robot.npz --holdout 1e-9",
    "fit {made}/drive.csv -o robot.npz --dt 0",
    "fit {made}/drive.csv -o robot.npz --dt nan",
    "fit {made}/drive.csv -o robot.npz --dt 1e9",
    "fit {made}/drive.csv -o robot.npz --dt 1e-9",
    "fit {made}/drive.csv -o robot.npz --gap -1",
    "fit {made}/drive.csv -o robot.npz --gap 0.01",
    "fit {made}/drive.csv -o robot.npz --horizon 0",
    "fit {made}/drive.csv -o robot.npz --horizon 1e9",
    "fit {made}/drive.csv -o robot.npz --lags 1 1",
    "fit {made}/drive.csv -o robot.npz --lags -1",
    "fit {made}/drive.csv -o robot.npz --product",
    "fit {made}/drive.csv -o robot.npz --method pinv",
    "fit {made}/drive.csv -o robot.npz --dictionary fourier",
    "fit {made}/drive.csv -o robot.npz --method edmdc --dictionary trig",
    "simulate --scenario nowhere",
    "simulate --scenario {made}/none.toml",
    "simulate --scenario {made}",
    "simulate --scenario {made}/run.npz",
    "simulate --model {made}/none.npz",
    "simulate --model {made}/run.npz",
    "simulate --model {made}/drive.csv",
    "simulate --seed -1",
    "simulate --slip -0.1",
    "simulate --slip nan",
    "simulate --margin -0.1",
    "simulate --margin inf",
    "simulate --horizon 0",
    "simulate --horizon 1e3",
    "simulate --iterations 0",
    "simulate --plant moon",
    "simulate --plant learned --slip 0.1",
    "simulate --scenario {made}/short.toml -o no/folder/run.npz",
    "simulate --scenario {made}/short.toml -o .",
    "simulate --scenario {made}/short.toml -o {made}/short.toml",
    "simulate --scenario {made}/short.toml --model {made}/robot.npz -o {made}/robot.npz",
    "report",
    "report {made}/none.npz",
    "report {made}/robot.npz",
    "report {made}/drive.csv",
    "report {made}/run.npz -o {made}/run.npz",
    "report {made}/run.npz -o run.html --model {made}/run.npz",
    "study",
    "study table2",
    "study table1 --trials 0",
    "study maps --maps 0",
    "study maps --controllers nobody",
    "study maps --families moon",
    "study table1 --workers 0",
    "study table1 --resume",
    "study maps --records {made}/drive.csv",
    "study faults --cluster nowhere",
    "study table1 --trials many",
    "study table1 --scenario nowhere",
    "demo --log {made}/none.csv",
    "demo --log {made}/robot.npz",
    "demo -o {made}/drive.csv",
    "bench --drives 0",
    "bench --only nobody",
    "bench --loop -5",
]


@pytest.mark.parametrize("line", BAD_LINES)
def test_bad_input_is_told_in_one_line_and_nothing_is_left_behind(
    line: str, made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {f: (made / f).read_bytes() for f in files(made)}
    try:
        status = cli.main([word.format(made=made) for word in line.split()])
    except SystemExit as ended:
        status = ended.code  # type: ignore[assignment]
    _, err = capsys.readouterr()
    assert status == 2
    assert err.startswith("kmpc") and len(err.splitlines()) == 1 and len(err) > 20
    assert files(here) == []
    assert {f: (made / f).read_bytes() for f in files(made)} == before


@NEEDS_PICTURES
@pytest.mark.parametrize(
    "line",
    [
        "report {made}/run.npz -o no/folder/run.html",
        "report {made}/run.npz --pictures {made}/drive.csv",
    ],
)
def test_a_report_that_cannot_be_written_is_told_in_one_line(
    line: str, made: Path, here: Path, capsys: pytest.CaptureFixture[str], blank: None
) -> None:
    assert cli.main([word.format(made=made) for word in line.split()]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert files(here) == []


def test_progress_is_drawn_on_a_terminal_only(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for terminal, quiet, drawn in ((False, False, False), (True, False, True), (True, True, False)):
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal)
        bar = Progress("work", quiet=quiet)
        for done in range(4):
            bar(done, 3)
        out, err = capsys.readouterr()
        assert out == ""
        assert ("work [##############################] 3/3" in err and err.endswith("\n")) == drawn
        assert bool(err) == drawn


def run_kmpc(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "kmpc_lite.cli.main", *arguments],
        text=True,
        capture_output=True,
        timeout=60,
        check=False,
        **options,
    )


def test_it_is_a_program() -> None:
    done = run_kmpc("--version")
    assert (done.returncode, done.stdout.strip(), done.stderr) == (
        0,
        f"kmpc_lite {kl.__version__}",
        "",
    )
    done = run_kmpc("simulate", "--scenario", "nowhere")
    assert done.returncode == 2 and len(done.stderr.splitlines()) == 1 and done.stdout == ""


@pytest.mark.parametrize(
    ("command", "buffered"),
    [
        (["simulate", "--scenario", "short.toml"], True),
        (["simulate", "--scenario", "short.toml"], False),
        (["fit", "--help"], True),
    ],
)
def test_a_reader_that_leaves_is_no_error(made: Path, command: list[str], buffered: bool) -> None:
    with open("/dev/null") as nothing:
        reader = subprocess.Popen(["true"], stdin=subprocess.PIPE)
        reader.wait()
        assert reader.stdin is not None
        done = subprocess.run(
            [sys.executable, "-m", "kmpc_lite.cli.main", *command],
            cwd=made,
            env={**os.environ, "PYTHONUNBUFFERED": "" if buffered else "1"},
            stdin=nothing,
            stdout=reader.stdin,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
            check=False,
        )
        reader.stdin.close()
    assert done.stderr == ""
    assert done.returncode == 141


def test_nobody_need_listen_at_all() -> None:
    """As behind ``>&-``: there is no standard output, and nothing is said of it."""
    command = f"{sys.executable} -m kmpc_lite.cli.main fit --help >&-"
    done = subprocess.run(["sh", "-c", command], stderr=subprocess.PIPE, text=True, timeout=60)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False)


def test_control_c_ends_it_at_once_without_a_traceback(tmp_path: Path) -> None:
    # it can never arrive: the goal is behind a wall of obstacles
    wall = ", ".join(f"[1.0, {y:.2f}, 0.15]" for y in np.arange(-2.0, 2.01, 0.2))
    endless = tmp_path / "endless.toml"
    endless.write_text(
        SHORT.replace("[[0.5, 0.6, 0.15]]", f"[{wall}]")
        .replace("0.7, 0.0, 0.0", "1.5, 0.0, 0.0")
        .replace("4.0", "1e5")
    )
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "kmpc_lite.cli.main",
            "simulate",
            "--scenario",
            str(endless),
            "-o",
            str(tmp_path / "run.npz"),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # where the tests run in the background it is ignored, and children inherit that
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    try:
        # at work once the solver's library is loaded
        maps = Path(f"/proc/{process.pid}/maps")
        while process.poll() is None and "osqp" not in maps.read_text():
            time.sleep(0.05)
        time.sleep(0.5)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    finally:
        process.kill()
    # the interpreter ends by the signal itself where that came while C code ran some Python of its
    # own, as a busy machine that still imports may do: a shell shows 130 for both
    assert process.returncode in (130, -signal.SIGINT) and err == "kmpc: stopped\n"
    assert out in ("", "Solver interrupted\n")  # OSQP's own words
    assert [p.name for p in tmp_path.iterdir()] == ["endless.toml"]


def test_run_files_of_other_scenarios_can_be_shown_again(made: Path) -> None:
    assert vars(Run.load(made / "run.npz").scenario) == vars(Scenario.load(made / "short.toml"))
